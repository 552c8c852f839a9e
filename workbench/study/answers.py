"""Answers of functions, declared in a Study: stored with it, and certified as part of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from workbench._core.heavy_types import Dataset
from workbench.answer import Answer
from workbench.certificate import Check, Checker, quantified_checks
from workbench.errors import InputError
from workbench.study.declarations import Declaration, Function, PartDeclaration
from workbench.study.packing import packed_datasets, unpacked_datasets

Labelled = Mapping[Any, Any]
Restored = dict[Any, tuple[Checker, Any]]
"""Checker and answer by label; the answer is None if none is stored."""


class AnswersDeclaration(Declaration):
    """Answers by label, and the function that returns the checker of each."""

    def __init__(self, function: Function) -> None:
        super().__init__(function)
        self.of_checkers: PartDeclaration | None = None

    def checkers(self, function: Function) -> PartDeclaration:
        """Declare the answers' checkers: a `Checker` by label, from the Study's data alone."""
        self.of_checkers = PartDeclaration(function)
        return self.of_checkers

    def variables(self, study: Any, get: Callable[[str], Any]) -> dict[str, Any]:
        """The dataset variables from which `restored` rebuilds the answers."""
        import xarray as xr

        checkers = self._checkers(study, get)
        found: dict[str, Dataset] = {}
        for label, answer in get(self.name).items():
            if answer is None:
                continue
            if not isinstance(answer, Answer):
                kind = type(answer).__name__
                raise InputError(f"{self.name!r} gave a {kind} for {label!r}; it needs an Answer")
            if label not in checkers:
                known = ", ".join(map(repr, checkers))
                raise InputError(f"{self.name!r} has no checker for {label!r}; there are {known}")
            checker = checkers[label]
            stored = checker.stored_answer(self.name, checker.witnessed(answer))
            found[label_words(label)] = xr.Dataset(stored)
        return packed_datasets(self.name, found)

    def restored(self, study: Any, get: Callable[[str], Any], data: Dataset) -> Restored:
        """Checker and answer by label; the answer is None if none is stored."""
        stored = unpacked_datasets(self.name, data)
        return {
            label: (
                checker,
                checker.restored_answer(self.name, stored[label_words(label)])
                if label_words(label) in stored
                else None,
            )
            for label, checker in self._checkers(study, get).items()
        }

    def _checkers(self, study: Any, get: Callable[[str], Any]) -> Labelled:
        if self.of_checkers is None:
            raise InputError(
                f"answers {self.name!r} of {type(study).__name__} need @{self.name}.checkers: "
                "a function that gives what certifies each of them"
            )
        checkers: Labelled = self.of_checkers.value(study, get)
        return checkers


def answers(function: Function) -> Any:
    """Declare answers of functions, by label; they are stored and certified with the Study.

    A second function, under ``@NAME.checkers``, returns the checker of each answer from the Study's
    data alone. `workbench verify` restores the answers and asks the checkers again. The Study's
    certificate holds their checks; of checks with the same statement, the worst. Arrays that need
    only the answers and dimensions are computed again from the restored answers, and must agree.
    Other declarations that need the answers get them as the function returned them: such
    declarations can be computed together with the arrays, but metrics and figures cannot use them.
    Return None for an answer that does not exist.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import control
    >>> from workbench import Study, solve
    >>> from workbench.mu import PeakChecker, peak
    >>> from workbench.structure import Full, Structure
    >>> from workbench.study import answers
    >>> @dataclass(frozen=True)
    ... class Norm(Study):
    ...     '''The H-infinity norm of a lag.'''
    ...
    ...     lag = control.ss(control.tf([1.0], [1.0, 2.0]))
    ...     structure = Structure([Full(1, 1)])
    ...
    ...     @answers
    ...     def norm(self):
    ...         return {"lag": peak(self.lag, self.structure)}
    ...
    ...     @norm.checkers
    ...     def of_the_lag(self):
    ...         return {"lag": PeakChecker(self.lag, self.structure)}
    ...
    >>> certificate = solve(Norm()).certificate
    >>> certificate.holds, certificate.checks[0].name
    (True, 'norm: peak')
    """
    return AnswersDeclaration(function)


def checks_of(
    name: str, found: Restored, checks: Callable[[Checker, Any], Iterable[Check]]
) -> list[Check]:
    """The checks of the answers of one declaration.

    Of checks with equal statements the worst is kept.

    ``where`` names the answer that the worst value belongs to.
    """
    worst: dict[tuple[Any, ...], Check] = {}
    for label, (checker, answer) in found.items():
        if answer is None:
            continue
        for check in quantified_checks(checker.quantifier, checks(checker, answer)):
            kind = (check.name, check.statement, check.limit, check.over, check.proven)
            other = worst.get(kind)
            if other is None or not check.value <= other.value:
                place = (
                    f"{label_words(label)}, {check.where}" if check.where else label_words(label)
                )
                title = f"{name.replace('_', ' ')}: {check.name}"
                worst[kind] = replace(check, name=title, where=place)
    return list(worst.values())


def label_words(label: Any) -> str:
    """A label as words; the parts of a tuple side by side."""
    return " ".join(map(str, label)) if isinstance(label, tuple) else str(label)
