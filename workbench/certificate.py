"""Certificates: checks of an answer from the data alone, and the checkers that issue them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, asdict, dataclass, field, replace
from textwrap import indent
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench._core.on_demand import no_more_names
from workbench.errors import InputError, WorkbenchError, words_of
from workbench.executor.effort import deeper
from workbench.solvers import Outcome

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "EVERY_FREQUENCY",
    "EVERY_PERTURBATION",
    "THIS_SYSTEM",
    "Certificate",
    "Check",
    "Checker",
    "Gap",
    "quantified_checks",
    "relative_excess",
    "worst_value",
]


def distinct_texts(value: float, limit: float, *, digits: int = 6) -> tuple[str, str]:
    """A value and its limit as texts, with as many digits as are needed to tell them apart.

    Examples
    --------
    >>> from workbench.certificate import distinct_texts
    >>> distinct_texts(0.99982, 1.0, digits=3), distinct_texts(0.98213, 1.0, digits=3)
    (('0.9998', '1'), ('0.982', '1'))
    """
    texts = "", ""
    for count in range(digits, MOST_DIGITS + 1):
        texts = f"{value:.{count}g}", f"{limit:.{count}g}"
        if texts[0] != texts[1] or value == limit:
            break
    return texts


MOST_DIGITS = 17
"""Digits that tell any two doubles apart."""


VALUE_IS = " " * 9 + "value: "
"""Start of the line that says what a check's value is, below the check's name."""


@dataclass(frozen=True)
class Check:
    """One statement that must hold: a measured value that may not exceed a limit.

    ``where`` names the place of the worst value, for instance a frequency. ``opinion`` marks the
    checks of the second opinion, which share neither code nor mathematics with the others. ``over``
    says what the statement quantifies over, such as "at every frequency, for these 12 plants".
    ``proven`` marks values that come from arithmetic which bounds its own error: exact, of balls,
    or of doubles with a proven rounding. Others are computed in doubles, and the limit is the slack
    for that.

    Examples
    --------
    >>> from workbench import Check
    >>> check = Check("inside", "largest distance [m]", value=0.75, limit=1.0)
    >>> check.holds, check.margin
    (True, 0.25)
    """

    name: str
    statement: str
    value: float
    limit: float
    _: KW_ONLY
    where: str = ""
    opinion: bool = False
    over: str = ""
    proven: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        for name in ("value", "limit"):
            number = getattr(self, name)
            if type(number) is not float:
                object.__setattr__(self, name, np.asarray(number, dtype=float).item())
        for name in ("name", "statement", "where", "over"):
            text = getattr(self, name)
            if type(text) is not str:
                object.__setattr__(self, name, str(text))

    @property
    def margin(self) -> float:
        """Limit less value: negative where the check fails, NaN where the value is NaN."""
        return self.limit - self.value

    @property
    def holds(self) -> bool:
        """Whether the value is at most its limit; NaN is not, and infinity is no limit."""
        return self.value <= self.limit < math.inf

    @property
    def verdict(self) -> str:
        """How it holds, proven or checked, or that it fails: words of one width."""
        return ("proven " if self.proven else "checked") if self.holds else "FAILS  "

    @property
    def line(self) -> str:
        """Whether it holds, its numbers and its set; below, what the value is and in which unit.

        Certificates print checks in this form.

        Examples
        --------
        >>> from workbench import Check
        >>> print(Check("inside", "largest distance [m]", value=0.75, limit=1.0).line)
        checked  inside: 0.75 <= 1
                 value: largest distance [m]
        """
        over = f"; {self.over}" if self.over else ""
        value, limit = distinct_texts(self.value, self.limit)
        line = f"{self.verdict}  {'second opinion, ' if self.opinion else ''}{self.name}: "
        line += f"{value} <= {limit} {self.where}".rstrip() + over
        return line + (f"\n{VALUE_IS}{self.statement}" if self.statement else "")

    @property
    def failure(self) -> str:
        """A sentence that says by which numbers it fails."""
        where = f" {self.where}" if self.where else ""
        value, limit = distinct_texts(self.value, self.limit)
        return f"{self.name}: {value} exceeds {limit}{where}"


EVERY_FREQUENCY = "at every frequency"
"""Quantifier of a bound that is proven from 0 to infinity, or to half the sampling rate."""
EVERY_PERTURBATION = f"{EVERY_FREQUENCY}, for every perturbation of the structure"
"""Quantifier of a proven peak of mu."""
THIS_SYSTEM = "for this one system"
"""Quantifier of the stability of one system or loop; nothing is claimed about a set of plants."""


def counted_quantifier(count: int, one: str, several: str) -> str:
    """A quantifier that counts the given things, such as "for these 3 plants".

    Examples
    --------
    >>> from workbench.certificate import counted_quantifier
    >>> counted_quantifier(1, "matrix", "matrices"), counted_quantifier(12, "matrix", "matrices")
    ('for this one matrix', 'for these 12 matrices')
    """
    return f"for this one {one}" if count == 1 else f"for these {count} {several}"


def quantified_checks(over: str, checks: Iterable[Check]) -> list[Check]:
    """The checks; ``over`` is filled in for those that have none.

    Examples
    --------
    >>> from workbench.certificate import Check, quantified_checks
    >>> checks = [Check("inside", "largest distance [m]", 0.75, 1.0)]
    >>> quantified_checks("for these 12 plants", checks)[0].over
    'for these 12 plants'
    """
    return [check if check.over else replace(check, over=over) for check in checks]


def relative_excess(value: float, claimed: float) -> float:
    """value / claimed - 1: 0 if both are equal.

    Infinite for a positive value over a claim of 0 or less.

    Examples
    --------
    >>> from workbench.certificate import relative_excess
    >>> relative_excess(1.5, 1.0), relative_excess(0.0, 0.0), relative_excess(1e-3, 0.0)
    (0.5, 0.0, inf)
    """
    if value == claimed:
        return 0.0
    return value / claimed - 1.0 if claimed > 0.0 else math.inf


@dataclass(frozen=True)
class Gap:
    """Largest relative distance of an answer from the optimum, by a bound not from the method.

    Examples
    --------
    >>> from workbench.certificate import Gap
    >>> gap = Gap("radius above its bound", value=2e-7, tolerance=1e-6, required=True)
    >>> gap.closed
    True
    """

    statement: str
    value: float
    tolerance: float
    required: bool

    def __post_init__(self) -> None:
        if type(self.value) is not float:
            object.__setattr__(self, "value", np.asarray(self.value, dtype=float).item())
        if type(self.statement) is not str:
            object.__setattr__(self, "statement", str(self.statement))

    @property
    def closed(self) -> bool:
        """Whether the absolute value is at most the tolerance."""
        return abs(self.value) <= self.tolerance

    @property
    def contradicts(self) -> bool:
        """Whether the answer is better than its bound allows, so that one of the two is wrong."""
        return self.value < -self.tolerance


@dataclass(frozen=True, repr=False)
class Certificate:
    """Checks of validity, all of which must hold, and the optimality gap if there is one.

    ``facts`` are sentences with further information on the answer; they are not checked.

    Examples
    --------
    >>> from workbench import Certificate, Check
    >>> good = Check("inside", "largest distance [m]", 0.75, 1.0)
    >>> bad = Check("stable", "largest real part [rad/s]", 0.1, 0.0)
    >>> Certificate((good,)).holds, Certificate((good, bad)).holds
    (True, False)
    """

    checks: tuple[Check, ...]
    _: KW_ONLY
    gap: Gap | None = None
    facts: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """Whether there are checks, all hold, and the gap does not contradict the answer."""
        beyond = self.gap is not None and self.gap.contradicts
        return self._decided and all(check.holds for check in self.checks) and not beyond

    @property
    def _decided(self) -> bool:
        """Whether the kernel made a check: a second opinion can refute but not confirm."""
        return any(not check.opinion for check in self.checks)

    @property
    def holds(self) -> bool:
        """Whether the answer is valid and, if its method claims the optimum, the gap is closed."""
        return self.valid and (self.gap is None or not self.gap.required or self.gap.closed)

    @property
    def outcome(self) -> Outcome:
        """Solved; inaccurate if only the optimality gap is too large; or failed."""
        if self.holds:
            return Outcome.SOLVED
        return Outcome.INACCURATE if self.valid else Outcome.FAILED

    @property
    def failures(self) -> tuple[str, ...]:
        """One sentence for each check that fails, and for the gap."""
        failed = [check.failure for check in self.checks if not check.holds]
        if not self._decided:
            failed.append("nothing is checked" + " but by a second opinion" * bool(self.checks))
        gap = self.gap
        if gap is not None and gap.contradicts:
            failed.append(f"optimality gap: {gap.value:.3g}, the answer lies beyond its bound")
        elif gap is not None and gap.required and not gap.closed:
            found, allowed = distinct_texts(gap.value, gap.tolerance, digits=3)
            failed.append(f"optimality gap: {found} exceeds {allowed}")
        return tuple(failed)

    def __repr__(self) -> str:
        lines = [f"Certificate: {self.outcome}"]
        lines += [indent(check.line, "  ") for check in self.checks]
        if self.gap is not None:
            needed = "required" if self.gap.required else "not claimed"
            lines.append(f"  gap {self.gap.value:.3g}, {needed} within {self.gap.tolerance:.3g}")
            lines.append(f"  {VALUE_IS}{self.gap.statement}")
        return "\n".join([*lines, *(f"  {fact}" for fact in self.facts)])

    def to_json(self) -> dict[str, Any]:
        """The certificate as data for `json`."""
        checks = [_check_to_json(check) for check in self.checks]
        gap = None if self.gap is None else asdict(self.gap) | {"closed": self.gap.closed}
        found = {"holds": self.holds, "valid": self.valid, "checks": checks, "gap": gap}
        return found | ({"facts": list(self.facts)} if self.facts else {})

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> Certificate:
        """The certificate whose data `to_json` gave."""
        gap = stored["gap"]
        return cls(
            tuple(Check(**_fields_from_json(check, "holds")) for check in stored["checks"]),
            gap=None if gap is None else Gap(**_fields_from_json(gap, "closed")),
            facts=tuple(map(str, stored.get("facts", ()))),
        )


def _check_to_json(check: Check) -> dict[str, Any]:
    """A check as data for `json`; the field ``proven`` is written only if it is true."""
    found = asdict(check) | {"holds": check.holds}
    return found if check.proven else {k: v for k, v in found.items() if k != "proven"}


def _fields_from_json(stored: Mapping[str, Any], derived: str) -> dict[str, Any]:
    """Fields from JSON, with NaN and infinities read from their names.

    The fields ``derived`` are skipped.
    """
    numbers, found = {"value", "limit", "tolerance"}, {}
    for name, entry in stored.items():
        if name == derived:
            continue
        if name not in numbers and not isinstance(entry, str | bool | None):
            raise TypeError(f"{name} is a {type(entry).__name__}")
        found[name] = float(entry) if name in numbers else entry
    return found


def worst_value(values: Any, labels: Callable[[tuple[int, ...]], str]) -> tuple[float, str]:
    """The largest of an array of values (NaN counts as largest) and the label of its place.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certificate import worst_value
    >>> distance = np.array([0.2, 0.9, 0.4])
    >>> worst_value(distance, lambda index: f"drive {index[0] + 1}")
    (0.9, 'drive 2')
    """
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.size == 0:
        return 0.0, ""
    place = np.unravel_index(
        int(np.argmax(np.where(np.isnan(values), math.inf, values))), values.shape
    )
    return float(values[place]), labels(tuple(int(i) for i in place))


class Checker(ABC):
    """The data of a question and the checks of its answers: `certify` issues a certificate.

    Every Program and every Study is a Checker. A function attaches one to its `Answer`.

    Examples
    --------
    >>> from workbench.certificate import Check, Checker
    >>> class Root(Checker):
    ...     quantifier = "for this one number"
    ...
    ...     def __init__(self, square):
    ...         self.square = square
    ...
    ...     def checks(self, answer, tolerance):
    ...         return [Check("square", "its distance", abs(answer**2 - self.square), 1e-12)]
    >>> Root(2.0).certify(2.0**0.5, 1e-6).holds, Root(2.0).certify(1.5, 1e-6).holds
    (True, False)
    """

    @property
    def quantifier(self) -> str:
        """Quantifier of those checks that do not state their own: frequencies, plants, data.

        For example "at the 400 given frequencies, for these 12 plants".
        """
        return ""

    @abstractmethod
    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        """Checks that an answer is valid, by the kernel, from the data alone."""

    def witnessed(self, answer: Any) -> Any:
        """The answer with the points that the second opinion tests, searched once and stored.

        `solve` calls this, so that `verify` need not search.
        """
        return answer

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        """Checks of a valid answer that share neither code nor mathematics with `checks`.

        They test the same claims in another way, and fail only if something is wrong.
        """
        return ()

    def deep_opinion(self, answer: Any) -> Sequence[Check]:
        """Expensive checks in the manner of `second_opinion`, made by `workbench verify --deep`.

        By default the second opinion with more draws, samples and frequencies
        (`workbench.executor.effort`). A checker that has another expensive test adds it here.
        """
        with deeper():
            return self.second_opinion(answer)

    def gap(self, answer: Any) -> tuple[str, float] | None:
        """Relative optimality gap by an independent bound, with a description.

        None if there is no bound.
        """
        return None

    def facts(self, answer: Any) -> Sequence[str]:
        """Further facts about a valid answer that its certificate states, such as an order."""
        return ()

    def headline_value(self, answer: Any) -> float:
        """The main number of an answer; NaN if it has none, or several."""
        return math.nan

    def figures(self, answer: Any) -> dict[str, Figure]:
        """Figures by file stem; they are returned, not written."""
        return {}

    def stored_answer(self, name: str, answer: Any) -> dict[str, Any]:
        """The answer as dataset variables whose names begin with ``name``.

        Raises
        ------
        InputError
            Answers of this kind are not stored in a Study.
        """
        kind = type(answer).__name__
        raise InputError(
            f"a {kind} cannot be stored in a Study: store what it was made from, such as its peak"
        )

    def restored_answer(self, name: str, data: Dataset) -> Any:
        """The answer that `stored_answer` wrote into a dataset under a name.

        None if it is not there.
        """
        raise InputError(f"a {type(self).__name__} stores no answers")

    def certify(self, answer: Any, tolerance: float, *, optimal: bool = False) -> Certificate:
        """Certificate of an answer; ``optimal`` if the method claims that it is the best one."""
        # A wrong answer may lead to a NaN in a check, which then fails.
        with np.errstate(all="ignore"):
            checks = _checks_or_failure(self.quantifier, lambda: self.checks(answer, tolerance))
            facts: tuple[str, ...] = ()
            if all(check.holds for check in checks):
                opinion = _checks_or_failure(self.quantifier, lambda: self.second_opinion(answer))
                checks += tuple(replace(check, opinion=True) for check in opinion)
                facts = tuple(self.facts(answer))
            try:
                gap = self.gap(answer)
            except _NUMERICAL as error:
                checks += (_not_computed(error),)
                gap = None
        proven = None if gap is None else Gap(gap[0], gap[1], tolerance, required=optimal)
        return Certificate(checks, gap=proven, facts=facts)


_NUMERICAL = (np.linalg.LinAlgError, ArithmeticError, ValueError)
"""Errors that arithmetic raises for numbers that it cannot use, such as NaN. A checker that knows
what is wrong with an answer raises an error of the workbench instead.
"""


def _checks_or_failure(over: str, find: Callable[[], Iterable[Check]]) -> tuple[Check, ...]:
    """The checks that ``find`` computes.

    One failing check if the answer's numbers do not allow it.
    """
    try:
        return tuple(quantified_checks(over, find()))
    except _NUMERICAL as error:
        return (_not_computed(error),)


def _not_computed(error: Exception) -> Check:
    if isinstance(error, WorkbenchError):
        raise error
    statement = "numbers of the answer with which a check cannot be computed"
    return Check("computed", statement, 1.0, 0.0, where=f"({words_of(error)})")


def deep_checks(checker: Checker, answer: Any) -> tuple[Check, ...]:
    """The expensive checks of a valid answer, each with its quantifier.

    Examples
    --------
    >>> from workbench.certificate import deep_checks
    >>> from workbench.geometry import SmallestCircle, smallest_circle
    >>> points = [0.0, 1.0, 1j]
    >>> [check.name for check in deep_checks(SmallestCircle(points), smallest_circle(points))]
    ['support']
    """
    with np.errstate(all="ignore"):
        found = _checks_or_failure(checker.quantifier, lambda: checker.deep_opinion(answer))
    return tuple(replace(check, opinion=True) for check in found)


@dataclass(frozen=True, eq=False)
class OriginalAnswerChecker(Checker):
    """Certifies an answer that was made from another checker's answer by certifying the latter.

    Examples
    --------
    >>> from workbench.certificate import OriginalAnswerChecker
    >>> from workbench.geometry import Circle, SmallestCircle, smallest_circle
    >>> points = [0.0, 1.0, 1j]
    >>> circle = smallest_circle(points)
    >>> diameter = OriginalAnswerChecker(SmallestCircle(points), circle)
    >>> diameter.certify(2 * circle.radius, 1e-6).holds
    True
    """

    checker: Checker
    original: Any

    @property
    def quantifier(self) -> str:
        return self.checker.quantifier

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        return self.checker.checks(self.original, tolerance)

    def second_opinion(self, answer: Any) -> Sequence[Check]:
        return self.checker.second_opinion(self.checker.witnessed(self.original))

    def deep_opinion(self, answer: Any) -> Sequence[Check]:
        return self.checker.deep_opinion(self.checker.witnessed(self.original))

    def gap(self, answer: Any) -> tuple[str, float] | None:
        return self.checker.gap(self.original)

    def facts(self, answer: Any) -> Sequence[str]:
        return self.checker.facts(self.original)

    def headline_value(self, answer: Any) -> float:
        return self.checker.headline_value(self.original)

    def figures(self, answer: Any) -> dict[str, Figure]:
        return self.checker.figures(self.original)
