"""The figures of docs/strangers.md: a plant's loops if they were run, otherwise its true responses.

workbench --results FOLDER run 'strangers/*/loop'
python docs/_tools/strangers.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from problems.strangers.loop import loop_figure  # noqa: E402
from problems.strangers.simulators.named import STRANGERS  # noqa: E402
from problems.strangers.truth import StrangerTruth  # noqa: E402
from workbench.bench.formats.netcdf import read  # noqa: E402
from workbench.types import Dataset  # noqa: E402

REFERENCE = ROOT / "results" / "reference"
PICTURES = ROOT / "docs" / "strangers"
DOTS_PER_INCH = 70


def main(results: Path) -> None:
    """Draw a figure of each plant, from its newest loop or from its stored true responses."""
    PICTURES.mkdir(exist_ok=True)
    for name, plant in STRANGERS.items():
        loop = newest(results, f"strangers/{name}/loop")
        if loop is not None and not loop.attrs["refused"]:
            figure = loop_figure(loop, plant)
        else:
            truth = newest(REFERENCE, f"strangers/{name}/truth")
            assert truth is not None, f"strangers/{name}/truth is not among the reference results"
            figure = StrangerTruth(name).figures(truth)["bode"]
            figure.axes[0].set_title(f"{plant.title}: true responses of {plant.units} units")
        figure.savefig(PICTURES / f"{name}.png", dpi=DOTS_PER_INCH)


def newest(results: Path, problem: str) -> Dataset | None:
    """The data of the newest run of a problem, whether its certificate holds or not."""
    files = sorted(results.glob(f"{problem}/*/data.nc"), key=lambda file: file.stat().st_mtime)
    return read(files[-1]) if files else None


if __name__ == "__main__":
    main(Path(sys.argv[1]))
