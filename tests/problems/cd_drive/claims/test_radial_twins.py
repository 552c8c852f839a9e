"""Whatever is shown of the focus loop is shown of the radial loop too."""

from pathlib import Path

from tables import each
from workbench.plants.cd_drive.claims.chapters import sources

STORED = Path(__file__).parents[4] / "results" / "reference"


ALONE = ("cd/focus/start-up",)
"""The lens is everywhere near a track, and has none to search for."""


def focus_only():
    return [name for name in sources() if name.startswith("cd/focus/") and name not in ALONE]


@each("name", focus_only())
def test_a_run_of_the_focus_loop_has_a_radial_twin(name):
    twin = STORED / name.replace("/focus/", "/radial/")
    assert any(twin.glob("*/data.nc"))
