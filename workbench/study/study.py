"""A Study: arrays, metrics and figures that are computed, with no choice of method."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, TypeVar

import numpy as np

from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.accuracy import ANY_ACCURACY_ALIKE, AccuracyRange
from workbench.certificate import Check, Checker
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import Claim, Task
from workbench.solvers import Outcome
from workbench.study.answers import AnswersDeclaration, Restored, checks_of
from workbench.study.checks import Checked
from workbench.study.declarations import (
    ArrayDeclaration,
    Declaration,
    Dim,
    PartDeclaration,
    System,
    VariablesDeclaration,
)
from workbench.study.views import Drawn, Metric, Table, stem

Kind = TypeVar("Kind", bound=Declaration)
STORED = Dim | ArrayDeclaration | System | VariablesDeclaration | AnswersDeclaration
"""Kinds of declarations that are stored in a dataset."""
STORED_ANSWERS = "for the stored answers"
"""Quantifier of the check of arrays that are made from stored answers."""


class Study(Task):
    """Arrays, metrics and figures that are computed, with no choice of method.

    The answer is a dataset.

    Subclasses are frozen dataclasses of the data they depend on. They declare dimensions, arrays,
    checks, metrics, tables and figures (see `workbench.study`), or define the methods of the same
    names below; both ways can be mixed.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, check, dim, metric
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...     small = check(
    ...         title="small", statement="the largest square", value=lambda square: square,
    ...         at_most=10.0
    ...     )
    ...     most = metric(lambda square: square.max())
    ...
    >>> solution = solve(Squares())
    >>> solution.certificate.holds, solution.metrics
    (True, {'most': 9.0})
    """

    accuracies: ClassVar[AccuracyRange] = ANY_ACCURACY_ALIKE
    """The tolerances that make a difference to `compute`; it receives no others."""

    def __init_subclass__(cls, **rest: Any) -> None:
        """Refuse a declaration whose name is taken by an attribute of Study."""
        super().__init_subclass__(**rest)
        for name, one in vars(cls).items():
            if isinstance(one, Declaration) and hasattr(Study, name):
                raise InputError(
                    f"{cls.__name__} declares {name!r}, which a Study has already; "
                    "give it another name"
                )

    def compute(self, context: Context) -> Dataset:
        """The arrays, each computed after the declarations that it needs.

        Raises
        ------
        InputError
            A declaration needs a name that is not declared, or needs itself through others; or an
            array does not fit its dimensions.
        """
        return _Computation(self, context).dataset()

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        get = self._getter(answer)
        declared = [one for check in self._declared(Checked) for one in check.checks(self, get)]
        restored = self._restored(answer)
        made = self._made_of(restored, get) if restored else []
        return (
            declared
            + made
            + _answer_checks(restored, lambda one, found: one.checks(found, tolerance))
        )

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        return _answer_checks(self._restored(answer), lambda one, found: one.second_opinion(found))

    def deep_opinion(self, answer: Dataset) -> Sequence[Check]:
        return _answer_checks(self._restored(answer), lambda one, found: one.deep_opinion(found))

    def _restored(self, answer: Dataset) -> dict[str, Restored]:
        """The declared answers of functions, with their checkers, restored from stored arrays."""
        stored, parts = self._getter(answer), {}
        declared = {one.name: one for one in self._declared(PartDeclaration)}

        def get(name: str) -> Any:
            """A stored value, or an intermediate result computed from stored values."""
            if name not in declared:
                return stored(name)
            if name not in parts:
                parts[name] = declared[name].value(self, get)
            return parts[name]

        data = in_doubles(answer)
        return {
            one.name: one.restored(self, get, data) for one in self._declared(AnswersDeclaration)
        }

    def _made_of(self, restored: dict[str, Restored], stored: Callable[[str], Any]) -> list[Check]:
        """Check that arrays made of answers and dimensions alone agree when made again."""
        answers = {
            name: {label: one for label, (_, one) in every.items()}
            for name, every in restored.items()
        }
        dims = {one.name for one in self._declared(Dim)}

        def get(name: str) -> Any:
            return answers[name] if name in answers else stored(name)

        apart: dict[str, int] = {}
        for one in self._declared(ArrayDeclaration):
            needs = set(one.needs)
            if needs & set(answers) and needs <= dims | set(answers):
                sizes = {name: stored(name).values for name in one.dims if name in dims}
                for name, (_, values, _) in one.variables(self, get, sizes).items():
                    kept = np.asarray(stored(name).values)
                    differ = (kept != values) & ~((kept != kept) & (values != values))  # NaN
                    apart[name] = int(np.count_nonzero(differ))
        if not apart:
            return []
        said = "entries of arrays that the stored answers do not have"
        where = ", ".join(name for name, count in apart.items() if count)
        differing = float(sum(apart.values()))
        return [Check("arrays of answers", said, differing, 0.0, where=where, over=STORED_ANSWERS)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        get = self._getter(answer)
        found: dict[str, float] = {}
        for one in self._declared(Metric):
            found |= one.metrics(self, get)
        return found

    def tables(self, answer: Dataset) -> dict[str, str]:
        get = self._getter(answer)
        made = (one.tables(self, get) for one in self._declared(Table))
        return {name: table for some in made for name, table in some.items()}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        drawings = self._drawings(answer).values()
        return {name: figure for draw in drawings for name, figure in draw().items()}

    def drawings(self, answer: Dataset) -> dict[str, Callable[[], Mapping[str, Figure]]]:
        # a method defined in the class, not a declaration
        if type(self).figures is not Study.figures:
            return super().drawings(answer)
        return self._drawings(answer)

    def _drawings(self, answer: Dataset) -> dict[str, Callable[[], Mapping[str, Figure]]]:
        get = self._getter(answer)
        return {stem(one.name): partial(one.figures, self, get) for one in self._declared(Drawn)}

    def respond(self, method: str | None, context: Context) -> Claim:
        return self.compute(context), Outcome.SOLVED, ""

    def claims_optimum(self, method: str | None) -> bool:
        if method is not None:
            raise InputError(f"{type(self).__name__} is a study: it has no method {method!r}")
        return False

    def accuracy_range(self, method: str | None) -> AccuracyRange:
        return self.accuracies

    def judging_tolerance(self, method: str | None, tolerance: float) -> float:
        return self.accuracies.served(tolerance)

    def _declared(self, kind: type[Kind]) -> Iterator[Kind]:
        """The declarations of a kind in their order; those of base classes come first."""
        return (one for one in declarations(type(self)).values() if isinstance(one, kind))

    def _getter(self, answer: Dataset) -> Callable[[str], Any]:
        """Function that looks up stored values by name, for checks, metrics, tables and figures."""
        answer = in_doubles(answer)
        systems = {one.name: one for one in self._declared(System)}
        optional = {name for one in self._declared(ArrayDeclaration) for name in one.names}

        def get(name: str) -> Any:
            if name == "answer":
                return answer
            if name in systems:
                return systems[name].restored(answer)
            if name in answer.variables or name in answer.dims:
                return answer[name]
            if name in optional:
                return None
            raise InputError(
                f"{type(self).__name__} stores no {name!r}; there are "
                f"{', '.join([*map(str, answer.variables), *systems])}"
            )

        return get


def _answer_checks(
    restored: dict[str, Restored], checks: Callable[[Checker, Any], Any]
) -> list[Check]:
    """Checks of the answers of all answer declarations."""
    every = (checks_of(name, found, checks) for name, found in restored.items())
    return [check for some in every for check in some]


def in_doubles(answer: Dataset) -> Dataset:
    """A dataset whose single-precision arrays are converted to double precision.

    In single precision, sums and moduli would differ between processors by more than metrics may.
    """
    narrow = {
        name: array.astype(np.result_type(array.dtype, float))
        for name, array in answer.variables.items()
        if array.dtype in (np.float32, np.complex64)
    }
    return answer.assign(narrow) if narrow else answer


def declarations(cls: type) -> dict[str, Declaration]:
    """The declarations of a class and of its bases, by name."""
    return {
        name: one
        for base in reversed(cls.__mro__)
        for name, one in vars(base).items()
        if isinstance(one, Declaration)
    }


class _Computation:
    """One run of a Study's declarations."""

    def __init__(self, study: Study, context: Context) -> None:
        self.study, self.context = study, context
        self.declared = declarations(type(study))
        self.home = {
            name: one
            for one in self.declared.values()
            if isinstance(one, ArrayDeclaration)
            for name in one.names
        }
        self.coordinates: dict[str, Any] = {}
        self.variables: dict[str, Any] = {}
        self.values: dict[str, Any] = {"context": context}
        self.waiting: list[str] = []

    def dataset(self) -> Dataset:
        import xarray as xr

        for one in self.declared.values():
            if isinstance(one, STORED):
                self._make(one)
        return xr.Dataset(self.variables, self.coordinates)

    def get(self, name: str) -> Any:
        """A declared thing by name; computed now if it has not been yet."""
        if name not in self.values:
            one = self.declared.get(name) or self.home.get(name)
            if one is None:
                known = sorted({*self.declared, *self.home, "context"})
                raise InputError(
                    f"{type(self.study).__name__} declares no {name!r}; there are "
                    f"{', '.join(known)}"
                )
            self._make(one)
        return self.values.get(name)

    def _make(self, one: Declaration) -> None:
        if one.name in self.values or one.name in self.waiting:
            if one.name in self.waiting:
                chain = " -> ".join([*self.waiting, one.name])
                raise InputError(f"{type(self.study).__name__}: {chain} need each other")
            return
        self.waiting.append(one.name)
        try:
            self._compute(one)
        finally:
            self.waiting.pop()

    def _compute(self, one: Declaration) -> None:
        import xarray as xr

        if isinstance(one, Dim):
            self.coordinates[one.name] = one.variable(self.study, self.get)
            self.values[one.name] = xr.DataArray(
                self.coordinates[one.name][1],
                dims=one.name,
                coords={one.name: self.coordinates[one.name]},
                attrs=self.coordinates[one.name][2],
            )
        elif isinstance(one, ArrayDeclaration):
            declared = [name for name in one.dims if isinstance(self.declared.get(name), Dim)]
            sizes = {name: self.get(name).values for name in declared}
            made = one.variables(self.study, self.get, sizes)
            (self.coordinates if one.coordinate else self.variables).update(made)
            for name in one.names:
                self.values[name] = self._labelled(made[name]) if name in made else None
            self.values[one.name] = self.values.get(one.name)
        elif isinstance(one, System):
            labels = [] if one.over is None else self.get(one.over).values.tolist()
            self.values[one.name] = value = one.value(self.study, self.get)
            self.variables |= one.variables(value, labels)
        elif isinstance(one, VariablesDeclaration):
            self.values[one.name] = made = one.value(self.study, self.get)
            self.variables |= made
        elif isinstance(one, PartDeclaration):
            self.values[one.name] = one.value(self.study, self.get)
        elif isinstance(one, AnswersDeclaration):
            self.values[one.name] = one.value(self.study, self.get)
            self.variables |= one.variables(self.study, self.get)
        else:
            raise InputError(f"{one.name!r} is made from stored arrays; no array may need it")

    def _labelled(self, variable: tuple[Any, ...]) -> DataArray:
        import xarray as xr

        dims, values, about = variable
        coords = {name: self.coordinates[name] for name in dims if name in self.coordinates}
        return xr.DataArray(values, dims=dims, coords=coords, attrs=about)
