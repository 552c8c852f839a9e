"""The law of the surface as functions: each tells the breaches of one rule.

The page that states the law is `docs/reference/conventions.md`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import control
from surface.reading import Said, Surface, type_of

OF_PYTHON_CONTROL = ("tf", "ss", "feedback", "series", "append", "interconnect")
"""Names of python-control that are offered with its signatures."""
PERIODIC = {
    "workbench.identification.PeriodicStream",
    "workbench.identification.periodic_local_polynomial",
    "workbench.identification.periodic_local_rational",
    "workbench.optics.TrackLayer",
}
"""Owners of a ``period`` that belongs to something periodic: an excitation, a row of pits."""
SUFFIX = {"Hz": "_hz", "deg": "_deg", "samples": "_samples"}
OF_ANY_UNIT = {
    *("band", "bandwidth", "corner", "corners", "crossover", "cutoff"),
    *("delay", "delays", "phase", "phases"),
}
"""Names whose unit a reader can only guess unless their docstring has it."""
FREQUENCIES = {"freq", "freqs", "frequency", "frequencies", "omegas"}
SAMPLING = {"sample_time", "sampling_time", "sampling_period", "Ts", "T_s"}
TOLERANCE = 1e-3
"""The default of ``tolerance``: the relative width of the interval that is proven."""
NORM, MARGIN, MINIMAL, WORST, BRANCHED = 1e-6, 1e-4, 1e-9, 1e-2, 0.05
"""Other defaults: norms and margins cost no more for more digits; minimal realisations leave out
what is rounding; the work of branching grows with every digit."""
TOLERANCES = {
    "workbench.mu.h_infinity_norm": NORM,
    "workbench.mu.linf_norm": NORM,
    "workbench.mu.loop_margins": MARGIN,
    "workbench.mu.margin_sensitivity": MARGIN,
    "workbench.mu.robust_stability": MARGIN,
    "workbench.mu.nu_gap": MARGIN,
    "workbench.mu.coprime_margin": MARGIN,
    "workbench.realisations.minimal_realisation": MINIMAL,
    "workbench.mu.worst_case_gain": WORST,
    "workbench.mu.branch_and_bound": BRANCHED,
}
DATA_BY_PLACE = {"y", "controller", "structure", "W_r", "measurements", "controls"}
"""Data that a question may do without: a record holds its output, a loop its controller, a system
its structure, and a set may be complex only. They stand behind the data before them."""
DECORATORS = {
    "workbench.study.metric": "template",
    "workbench.study.system": "over",
    "workbench.study.table": "function",
}
"""Decorators that may stand without brackets: what they decorate is given by its place."""
RATES = {"sample_rate", "sampling_rate", "sampling_frequency", "fs", "f_s"}
SYNONYMS = {
    "tolerance": {"tol", "rtol", "atol", "eps", "epsilon", "precision", "accuracy", "gap"},
    "order": {"model_order", "n_states", "number_of_states", "nx"},
    "confidence": {"confidence_level", "significance", "level", "alpha"},
    "seed": {"random_seed", "random_state"},
    "time_limit": {"timeout", "max_time", "maximum_time"},
    "method": {"solver", "algorithm", "backend"},
    "plant": {"G", "P", "process"},
    "controller": {"K", "C", "compensator", "regulator"},
}
"""Words that mean the same as the one that is lawful."""
PLANTS, CONTROLLERS = {"plant", "G", "P"}, {"controller", "K"}
NUMBER = re.compile(r"^(float|int|bool)( \| (float|int|str|None))*$")
NAME = re.compile(r"^str( \| (Path|None))*$")
QUANTITY = re.compile(r"^$|\b(float|int|complex|Any|ndarray|NDArray\w*|\w*Array|ArrayLike)\b")
SYSTEM = re.compile(r"^$|\b(Any|StateSpace|TransferFunction|LTI|UncertainSystem)\b")
DATA = re.compile(
    r"Array|ndarray|Dataset|Record|Experiments|Responses|Model\b|Plant\b|StateSpace|"
    r"TransferFunction|UncertainSystem|Structure|Rational\b"
)


@dataclass(frozen=True)
class Breach:
    """A public name that breaks a rule."""

    rule: str
    place: str
    lawful: str


def units(surface: Surface) -> Iterator[Breach]:
    """Hz ends in `_hz`, degrees in `_deg`, samples in `_samples`; the docstring says the unit."""
    for one in surface.names:
        if not _is_quantity(one) or _is_rate(one):
            continue
        suffix = SUFFIX.get(one.unit, "")
        ends = next((s for s in SUFFIX.values() if one.name.endswith(s)), "")
        if one.name in FREQUENCIES or (one.name == "omega" and suffix):
            yield _named("units", one, _frequency(one))
        elif suffix and one.name != "samples" and not one.name.endswith(suffix):
            yield _named("units", one, one.name + suffix)
        elif ends and ends != suffix:
            unit = next(unit for unit, s in SUFFIX.items() if s == ends)
            yield _named("units", one, f"{one.name} [{unit}] in its docstring")
        elif one.name in OF_ANY_UNIT and not one.unit:
            yield _named("units", one, f"{one.name} with its unit in its docstring")


def sampling(surface: Surface) -> Iterator[Breach]:
    """The sampling time is `dt`; `period` belongs to something periodic."""
    for one in surface.names:
        period = one.name == "period" and one.owner not in PERIODIC and _is_quantity(one)
        if one.name in SAMPLING or period:
            yield _named("sampling", one, "dt")
        elif _is_rate(one):
            yield _named("sampling", one, "dt, its reciprocal")


def words(surface: Surface) -> Iterator[Breach]:
    """One word for one thing: no synonym of `tolerance`, `order`, `plant`, `controller`, ..."""
    for one in surface.names:
        for lawful, synonyms in SYNONYMS.items():
            if one.name in synonyms and _means(lawful, one):
                yield _named("words", one, lawful)


def tolerances(surface: Surface) -> Iterator[Breach]:
    """`tolerance` has one default, but for what `TOLERANCES` names; a run's may be a word."""
    for one in surface.names:
        number = isinstance(one.default, int | float)
        lawful = TOLERANCES.get(one.owner, TOLERANCE)
        if one.name == "tolerance" and number and one.default != lawful:
            yield _named("tolerances", one, f"tolerance={lawful:g}, not {one.default:g}")


def order(surface: Surface) -> Iterator[Breach]:
    """Plants stand before controllers, data before settings."""
    for call in surface.calls:
        if _is_control(call.owner):
            continue
        firsts = [p for p in call.parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
        systems = [p.name for p in firsts if SYSTEM.search(type_of(p)) or DATA.search(type_of(p))]
        plants = [i for i, name in enumerate(systems) if name in PLANTS]
        controllers = [i for i, name in enumerate(systems) if name in CONTROLLERS]
        if plants and controllers and controllers[0] < plants[0]:
            both = f"{systems[controllers[0]]}, {systems[plants[0]]}"
            yield Breach("order", f"{call.owner}({both})", "(plant, controller)")
        if call.answer or call.kind == "tuple":
            continue
        needed = [p for p in firsts if p.default is p.empty]
        settings = [i for i, p in enumerate(needed) if NUMBER.match(type_of(p))]
        data = [i for i, p in enumerate(needed) if DATA.search(type_of(p))]
        if settings and data and settings[0] < data[-1]:
            first, last = needed[settings[0]].name, needed[data[-1]].name
            yield Breach("order", f"{call.owner}({first}, {last})", f"{last} before {first}")


def keywords(surface: Surface) -> Iterator[Breach]:
    """Settings with a default are given by their keywords, but for a name that comes first."""
    for call in surface.calls:
        if call.kind == "tuple" or _is_control(call.owner):
            continue
        by_place = {*DATA_BY_PLACE, DECORATORS.get(call.owner)}
        first = next(iter(call.parameters), None)
        if first is not None and first.default is not first.empty and NAME.match(type_of(first)):
            by_place.add(first.name)
        optional = ", ".join(
            one.name
            for one in call.parameters
            if one.kind is one.POSITIONAL_OR_KEYWORD
            and one.default is not one.empty
            and one.name not in by_place
        )
        if optional:
            yield Breach("keywords", f"{call.owner}({optional})", f"(*, {optional})")


def docstrings(surface: Surface) -> Iterator[Breach]:
    """Every function, method, class and property says what it is."""
    for call in surface.calls:
        if not call.words:
            yield Breach("docstrings", call.owner, "a docstring")
    for one in surface.names:
        if one.kind == "property" and not one.words:
            yield _named("docstrings", one, "a docstring")


def python_control(surface: Surface, theirs: Mapping[str, Any] | None = None) -> Iterator[Breach]:
    """A name of python-control takes all that python-control's function takes."""
    known = theirs or {name: getattr(control, name) for name in OF_PYTHON_CONTROL}
    for call in surface.calls:
        name = call.owner.rpartition(".")[2]
        if call.kind != "function" or name not in known:
            continue
        ours = {p.name: p for p in call.parameters}
        kinds = {p.kind for p in call.parameters}
        for one in inspect.signature(known[name]).parameters.values():
            star = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "")
            if one.name not in ours if not star else one.kind not in kinds:
                place = f"{call.owner}({star}{one.name})"
                yield Breach("python_control", place, f"takes {star}{one.name} as control.{name}")


RULES = (units, sampling, words, tolerances, order, keywords, docstrings, python_control)


def breaches(surface: Surface) -> Iterator[Breach]:
    """The breaches of every rule."""
    for rule in RULES:
        yield from rule(surface)


def _named(rule: str, one: Said, lawful: str) -> Breach:
    return Breach(rule, one.place, lawful)


def _is_quantity(one: Said) -> bool:
    return bool(QUANTITY.search(one.type)) and "str" not in one.type.split(" | ")[0]


def _is_rate(one: Said) -> bool:
    """Whether it is a rate of sampling; other rates, such as one of decay, are called rates."""
    return one.name in RATES or (one.name == "rate" and one.unit == "Hz")


def _is_control(owner: str) -> bool:
    """Whether it is a function of a room with a name of python-control; no method is."""
    *_, room, name = owner.split(".")
    return name in OF_PYTHON_CONTROL and room.islower()


def _frequency(one: Said) -> str:
    """The lawful name of something that is called a frequency."""
    if one.type == "int":
        return "a count, such as points"
    in_hz = ("frequencies" if one.name.endswith("s") else "frequency") + "_hz"
    return {"rad/s": "omega", "Hz": in_hz}.get(one.unit, f"omega [rad/s] or {in_hz} [Hz]")


def _means(lawful: str, one: Said) -> bool:
    """Whether a word stands for the lawful one, which its type and what is said of it tell."""
    if _is_control(one.owner):
        return False
    if lawful in {"plant", "controller"}:  # letters of formulas are right in answers
        return not one.answer and bool(SYSTEM.search(one.type))
    if lawful == "method":
        return one.type.startswith(("str", "Literal"))
    if one.name in {"level", "alpha"}:
        return bool(re.search("confiden|significan|probab", one.words))
    if one.name in {"accuracy", "gap", "precision"}:  # a setting, not what was found, nor a format
        return one.type.startswith("float") and one.default is not inspect.Parameter.empty
    return True
