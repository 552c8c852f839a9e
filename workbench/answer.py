"""One kind of answer: a number, what it quantifies over, and the certificate that proves it."""

from __future__ import annotations

import math
import pickle
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from workbench._core.heavy_types import Dataset, Figure
from workbench.accuracy import DEFAULT_TOLERANCE
from workbench.certificate import Certificate, Check, Checker, quantified_checks, relative_excess
from workbench.errors import InputError, SolverError, UnknownNameError
from workbench.executor import Context
from workbench.program import Program
from workbench.solvers import Options, Outcome

REPEATED_ROUNDING = 1e-9
"""Relative amount by which a claimed bound may be better than the recomputed one, since processors
round differently.
"""
_carried: ContextVar[bool] = ContextVar("_carried", default=False)
"""Whether an answer that contains other answers is being sent to another process."""


class Answer:
    """The result of a method or a function, with the checker that certifies it.

    `certificate` and `holds` make the certificate when they are first used; an answer whose
    certificate nobody asks for costs only its computation. An answer that was made by hand, or
    changed by `dataclasses.replace`, has no certificate.

    Examples
    --------
    >>> from workbench.geometry import smallest_circle
    >>> circle = smallest_circle([0, 1, 1j])
    >>> circle.holds, len(circle.certificate.checks)
    (True, 2)
    """

    _checked_by: tuple[Checker, float, bool] | None = None
    """Its checker, the tolerance of the gap, and whether the answer is claimed to be optimal."""

    def with_checker(
        self,
        checker: Checker,
        *,
        gap_tolerance: float = DEFAULT_TOLERANCE,
        optimal: bool = False,
        certificate: Certificate | None = None,
    ) -> Self:
        """This answer, with its checker attached.

        Parameters
        ----------
        checker
            Certifies the answer, by `Checker.certify`.
        gap_tolerance
            Relative optimality gap that the certificate allows.
        optimal
            Whether this answer is claimed to be the best one.
        certificate
            Its certificate, if that has been made already.
        """
        vars(self)["_checked_by"] = checker, gap_tolerance, optimal
        vars(self).pop("certificate", None)
        if certificate is not None:
            vars(self)["certificate"] = certificate
        return self

    @cached_property
    def certificate(self) -> Certificate | None:
        """What was checked, by how much it holds, and for what.

        None if the answer has no checker.
        """
        if self._checked_by is None:
            return None
        checker, tolerance, optimal = self._checked_by
        return checker.certify(checker.witnessed(self), tolerance, optimal=optimal)

    @property
    def holds(self) -> bool:
        """Whether there is a certificate and it holds. The first use makes the certificate."""
        return self.certificate is not None and self.certificate.holds

    def plot(self, name: str | None = None) -> Figure:
        """A figure of the answer, by name; None: the main one. A notebook shows it.

        Raises
        ------
        InputError, UnknownNameError
            The answer has no figure, or none of this name.
        """
        drawn = self._checked_by[0].figures(self) if self._checked_by else {}
        if not drawn:
            raise InputError(f"there is no figure of a {type(self).__name__}")
        name = name or next(iter(drawn))
        if name not in drawn:
            raise UnknownNameError("figure", name, drawn)
        return drawn[name]

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Prepare the whole answer for another process.

        Cloudpickle serialises systems and checkers.

        Each answer that is contained in it, or in its checker, is sent once.
        """
        if _carried.get():
            return super().__reduce_ex__(protocol)
        import cloudpickle

        outermost = _carried.set(True)
        try:
            return pickle.loads, (cloudpickle.dumps(self),)
        finally:
            _carried.reset(outermost)

    def __repr__(self) -> str:
        return f"{self.summary()}\n  {self._proof()}"

    def summary(self) -> str:
        """The numbers of the answer as text, in one line or a few."""
        if hasattr(self, "lower"):
            numbers = f"from {_shown(self.lower)} to {_shown(self.upper)}"  # type: ignore[attr-defined]
        else:
            numbers = _shown(self.value)  # type: ignore[attr-defined]
        return f"{type(self).__name__}: {numbers}"

    def _proof(self) -> str:
        """Text that says what the numbers quantify over, and whether the certificate holds."""
        if self._checked_by is None:
            return "no certificate: made by hand, or changed"
        over = self._checked_by[0].quantifier
        found = vars(self).get("certificate")
        if found is None:
            state = "certificate made when asked for"
        elif found.holds:
            state = f"certificate holds, {len(found.checks)} checks"
        else:
            state = f"certificate FAILS: {'; '.join(found.failures)}"
        return f"{over}; {state}" if over else state


class ProgramAnswer(Answer):
    """An answer of a Program, whose number is the metric that the Program is known by."""

    @property
    def value(self) -> float:
        """That metric; NaN if the answer has no checker or no such metric."""
        return self._checked_by[0].headline_value(self) if self._checked_by else math.nan


class PartsChecker(Checker):
    """Certifies an answer that consists of other answers, each with its own certificate."""

    @abstractmethod
    def parts(self, answer: Any) -> Mapping[str, Answer | None]:
        """The contained answers by name; None for a missing one, about which nothing is claimed."""

    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        """Checks of the answer itself, in addition to those of its parts."""
        return ()

    def certify(self, answer: Any, tolerance: float, *, optimal: bool = False) -> Certificate:
        own = super().certify(answer, tolerance, optimal=optimal)
        checks = list(own.checks)
        for name, part in self.parts(answer).items():
            if part is None:
                continue
            found = part.certificate
            if found is None:
                missing = "number of its certificates that are missing"
                checks.append(Check(name, missing, 1.0, 0.0, over=self.quantifier))
                continue
            checks += [replace(check, name=f"{name}: {check.name}") for check in found.checks]
        return replace(own, checks=tuple(checks))

    def deep_opinion(self, answer: Any) -> list[Check]:
        checks = list(super().deep_opinion(answer))
        for name, part in self.parts(answer).items():
            if part is not None and part._checked_by is not None:
                checker = part._checked_by[0]
                found = checker.deep_opinion(checker.witnessed(part))
                over = quantified_checks(checker.quantifier, found)
                checks += [replace(check, name=f"{name}: {check.name}") for check in over]
        return checks


def stored_numbers(name: str, answer: Any, *fields: str) -> dict[str, Any]:
    """Numbers of an answer as dataset variables; `restored_numbers` reads them back."""
    return {f"{name}_{field}": ((), getattr(answer, field)) for field in fields}


def restored_numbers(name: str, data: Dataset, *fields: str) -> dict[str, float] | None:
    """The numbers by field; None if the dataset has none under this name."""
    if f"{name}_{fields[0]}" not in data:
        return None
    return {field: float(data[f"{name}_{field}"]) for field in fields}


@dataclass(frozen=True, eq=False)
class RepeatedChecker(Checker):
    """Checks bounds by recomputing them from the data alone, for bounds without a shorter proof."""

    again: Callable[[], Any]
    """Recomputes the answer."""
    over: str
    """What its numbers quantify over."""

    @property
    def quantifier(self) -> str:
        return self.over

    def stored_answer(self, name: str, answer: Any) -> dict[str, Any]:
        bounds = {"lower": np.asarray(answer.lower), "upper": np.asarray(answer.upper)}
        return {
            f"{name}_{side}": (
                [f"{name}_{place}" for place in range(values.ndim)],
                values,
                {"long_name": f"{side} bound"},
            )
            for side, values in bounds.items()
        }

    def restored_answer(self, name: str, data: Dataset) -> Any:
        if f"{name}_lower" not in data:
            return None
        lower, upper = (data[f"{name}_{side}"].values for side in ("lower", "upper"))
        return replace(self.again(), lower=_plain(lower), upper=_plain(upper))

    def checks(self, answer: Any, tolerance: float) -> list[Check]:
        found = self.again()
        statement = "by which share the claimed bound is better than the one computed again"
        crossed = np.any(np.asarray(answer.lower) > answer.upper)
        return [
            *no_better(answer, found.lower, found.upper, statement, REPEATED_ROUNDING),
            Check("order", "whether a lower bound is above the upper", float(crossed), 0.0),
        ]


def no_better(answer: Any, lower: Any, upper: Any, statement: str, limit: float) -> list[Check]:
    """Checks that the bounds of an answer are no better than bounds that are proven.

    ``lower`` and ``upper`` are the proven bounds, numbers or arrays. The value of a check is the
    relative amount by which the claimed bound is better than the proven one; ``statement``
    describes it.
    """
    return [
        Check("lower", statement, _largest(answer.lower, lower), limit),
        Check("upper", statement, _largest(upper, answer.upper), limit),
    ]


def _largest(values: Any, claimed: Any) -> float:
    """The largest `excess` of the values over the claimed ones, entry by entry."""
    pairs = np.broadcast(np.asarray(values, dtype=float), np.asarray(claimed, dtype=float))
    return max((relative_excess(float(one), float(other)) for one, other in pairs), default=0.0)


def _plain(values: Any) -> Any:
    """A float for an array without dimensions, otherwise the array."""
    return values if values.ndim else values.item()


def _shown(value: Any) -> str:
    """A number as text; for an array the range of its numbers."""
    values = np.asarray(value, dtype=float)
    if values.size == 1:
        return f"{values.item():.6g}"
    if not values.size:
        return "none"
    return f"{values.min():.6g} .. {values.max():.6g} ({values.size})"


def answer_of(
    program: Program,
    method: str | None = None,
    options: Options | None = None,
    executor: Executor | None = None,
    usable: Callable[[Any], bool] = lambda answer: True,
) -> Any:
    """The answer of a Program by a method; its certificate is made when somebody asks for it.

    ``usable`` tells whether the method's result counts as an answer, for instance whether it is
    finite.

    Raises
    ------
    UnknownNameError, InputError
        As `find_method`.
    SolverError
        The method gave no usable answer.
    """
    context = Context(options=options or Options(), executor=executor)
    answer, claim, message = program.respond(method, context)
    if answer is None or not usable(answer):
        raise SolverError(f"{method or program.default_method}: {claim}. {message}")
    optimal = program.claims_optimum(method) and claim is not Outcome.TIME_LIMIT
    tolerance = program.judging_tolerance(method, context.options.accuracy)
    return answer.with_checker(program, gap_tolerance=tolerance, optimal=optimal)
