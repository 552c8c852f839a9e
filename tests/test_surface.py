"""Every public name obeys the law of the surface.

The page `docs/reference/conventions.md` states the law.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from surface.reading import library, read
from surface.rules import RULES, SYNONYMS, breaches, python_control

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "conventions.md"


def test_every_public_name_is_lawful():
    told = [f"{one.place} breaks {one.rule!r}; lawful: {one.lawful}" for one in breaches(library())]
    assert not told, "\n".join(told)


def test_the_surface_is_read():
    """Names of every kind are there, with what their docstrings say of them."""
    names = {one.place: one for one in library().names}
    assert len(names) > 2000
    assert names["workbench.mu.peak(band)"].unit == "rad/s"  # a section
    assert names["workbench.simulation.Repetitive.corner_hz"].unit == "Hz"  # a table
    assert names["workbench.mu.Sweep.within(low)"].unit == "rad/s"  # prose
    assert names["workbench.uncertainty.Responses.frequency_hz"].kind == "property"
    assert names["workbench.mu.CoprimeMargin.omega"].answer
    assert not names["workbench.synthesis.HinfSynthesis.plant"].answer
    calls = {one.owner for one in library().calls}
    assert {"workbench.solve", "workbench.mu.Sweep", "workbench.mu.Sweep.within"} <= calls


def test_the_page_states_the_words():
    text = PAGE.read_text(encoding="utf-8")
    for word in (*SYNONYMS, "omega", "_hz", "_deg", "_samples", "dt", "period", "certificate"):
        assert f"`{word}`" in text, word


def surface(*objects):
    return read((f"made.up.{one.__name__}", one) for one in objects)


# --- every rule bites ---------------------------------------------------------------------------


def in_hz(corner: float) -> None:
    """A corner frequency: ``corner`` [Hz]."""


def in_prose(low: float, high: float) -> None:
    """What lies between `low` and `high` [Hz]."""


def in_degrees(phase: float) -> None:
    """Turn.

    Parameters
    ----------
    phase
        Angle [deg]. It is not the [rad/s] of something else.
    """


def in_samples(delay: float) -> None:
    """Delay.

    delay    time [samples] of the computer;
    """


def bare(frequency: Any) -> None:
    """Frequencies without a unit."""


def undocumented(corner_hz: float) -> None:
    """A corner without a unit."""


def mistaken(omega: Any) -> None:
    """Responses at ``omega`` (F,) [Hz]."""


@dataclass(frozen=True)
class Corners:
    """What a class says of its fields."""

    first: float
    """First corner [Hz]."""

    @functools.cached_property
    def second(self) -> float:
        """Second corner [Hz]."""
        return 2 * self.first


def sampled(period: float) -> None:
    """At a sampling time [s]."""


def at_rate(sample_rate: float) -> None:
    """At a sampling rate [Hz]."""


def precise(*, tol: float = 1e-3, timeout: float = 1.0) -> None:
    """To a tolerance, within a time."""


def sure(*, level: float = 0.95) -> None:
    """``level``: the probability."""


def sure_of_noise(*, level: float = 0.95) -> None:
    """``level``: of the noise."""


def chosen(*, solver: str = "fast") -> None:
    """With a solver."""


def closed(plant: Any, K: Any) -> None:
    """Loop of a plant with a controller."""


def loose(*, tolerance: float = 0.1) -> None:
    """Bounds to a tolerance."""


def backwards(controller: Any, plant: Any) -> None:
    """Loop of a plant with a controller."""


def settings_first(order: int, points: np.ndarray) -> None:  # noqa: F821  (read as text)
    """Fit."""


def positional(points: Any, order: int = 2, weight: Any = None, *, method: str = "") -> None:
    """Fit."""


def held(u: Any, y: Any = None, *, order: int = 2) -> None:
    """Fit: a record as the first argument holds its output."""


@dataclass(frozen=True)
class Fit:
    """A question with an argument that has a default."""

    points: Any
    order: int = 2


class Chain:
    """A class whose method has a name of python-control, and is none of its functions."""

    def append(self, points: Any, order: int = 2) -> None:
        """Add points."""


def silent(points: Any) -> None:
    pass


@dataclass
class Silent:
    points: Any


class Answer(NamedTuple):
    """Its fields have defaults, and no way to be told by keyword alone."""

    K: Any = None


@dataclass(frozen=True)
class Design:
    """A letter of a formula, in an answer."""

    K: Any


def designed(
    plant: Any, points: Any, *, tolerance: float = 1e-3, precision: str = "double"
) -> tuple[Design, Answer]:
    """Controller of a plant."""


@dataclass(frozen=True)
class Lawful:
    """Every unit in its place.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s].
    band_hz
        Frequencies [Hz].
    phase_deg, delay_samples
        Phase [deg] and delay [samples].
    dt
        Sampling time [s].
    """

    omega: Any
    band_hz: tuple[float, float]
    phase_deg: float
    delay_samples: float
    dt: float = field(default=0.0, kw_only=True)

    @property
    def samples(self) -> int:
        """Length of the record [samples]."""
        return 1

    @property
    def rates(self) -> dict[str, str]:
        """What is said in Hz, by name."""
        return {}


def lawful(plant: Any, controller: Any, order: int, *, rate: float = 1.0) -> Lawful:
    """A loop; ``rate`` [1/s] of its decay."""


LAWFUL = [Answer, Design, Lawful, designed, held, lawful, sure_of_noise]
UNLAWFUL = [
    ("units", in_hz, {"(corner)": "corner_hz"}),
    ("units", in_prose, {"(low)": "low_hz", "(high)": "high_hz"}),
    ("units", in_degrees, {"(phase)": "phase_deg"}),
    ("units", in_samples, {"(delay)": "delay_samples"}),
    ("units", bare, {"(frequency)": "omega [rad/s] or frequency_hz [Hz]"}),
    ("units", undocumented, {"(corner_hz)": "corner_hz [Hz] in its docstring"}),
    ("units", mistaken, {"(omega)": "frequency_hz"}),
    ("units", Corners, {".first": "first_hz", ".second": "second_hz"}),
    ("sampling", sampled, {"(period)": "dt"}),
    ("sampling", at_rate, {"(sample_rate)": "dt, its reciprocal"}),
    ("words", precise, {"(tol)": "tolerance", "(timeout)": "time_limit"}),
    ("words", sure, {"(level)": "confidence"}),
    ("words", chosen, {"(solver)": "method"}),
    ("words", closed, {"(K)": "controller"}),
    ("tolerances", loose, {"(tolerance)": "tolerance=0.001, not 0.1"}),
    ("order", backwards, {"(controller, plant)": "(plant, controller)"}),
    ("order", settings_first, {"(order, points)": "points before order"}),
    ("keywords", positional, {"(order, weight)": "(*, order, weight)"}),
    ("keywords", Fit, {"(order)": "(*, order)"}),
    ("keywords", Chain, {".append(order)": "(*, order)"}),
    ("docstrings", silent, {"": "a docstring"}),
    ("docstrings", Silent, {"": "a docstring"}),
]


@pytest.mark.parametrize("one", LAWFUL, ids=lambda one: one.__name__)
def test_a_lawful_name_is_left_alone(one):
    assert list(breaches(surface(one, designed))) == []


@pytest.mark.parametrize(
    ("rule", "one", "lawful"), UNLAWFUL, ids=lambda one: getattr(one, "__name__", None)
)
def test_a_rule_bites(rule, one, lawful):
    path = f"made.up.{one.__name__}"
    found = {(breach.rule, breach.place): breach.lawful for breach in breaches(surface(one))}
    assert found == {(rule, path + place): name for place, name in lawful.items()}


def test_every_rule_is_tried():
    assert {rule.__name__ for rule in RULES} == {rule for rule, *_ in UNLAWFUL} | {"python_control"}


def test_names_of_python_control_take_what_it_takes():
    def feedback(sys1, sys2=1, sign=-1, **kwargs):
        """Theirs."""

    def theirs(sys1, sys2=1, sign=-1, **kwargs):
        """As theirs, with other words for what it holds."""

    theirs.__name__ = "feedback"

    def narrower(sys1, sys2=1):
        """Ours takes less."""

    narrower.__name__ = "feedback"
    known = {"feedback": feedback}
    assert list(python_control(surface(theirs), known)) == []
    assert list(breaches(surface(theirs))) == []  # its defaults are given by place, as theirs are
    places = [one.place for one in python_control(surface(narrower), known)]
    assert places == ["made.up.feedback(sign)", "made.up.feedback(**kwargs)"]
