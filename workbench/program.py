"""The one idea: a Program is data with checks, methods answer it, a certificate decides.

A `Program` is one family of optimisation problems: its data and a check of any answer.
A *method* is anything that answers a Program. What a method says is never believed; a small kernel
decides (`workbench.certify`); a second opinion, made by other mathematics, checks the kernel.
A `Certificate` (`workbench.certificate`) says what was checked, and by how much it holds.
A `Study` (see `workbench.study`) has no method to choose: arrays with checks of its own.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import math
import sys
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from workbench._core.arrays import read_only
from workbench._core.heavy_types import Dataset, Figure
from workbench._core.on_demand import no_more_names
from workbench.accuracy import (
    ANY_ACCURACY_ALIKE,
    DEFAULT_TOLERANCE,
    EVERY_ACCURACY,
    AccuracyRange,
)
from workbench.certificate import Checker
from workbench.errors import InputError, RegistryError, SolverError, UnknownNameError
from workbench.executor import Context
from workbench.input_checks import need_kind
from workbench.solvers import ConicSolver, Outcome, for_every_conic_solver

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = ["ANY_ACCURACY_ALIKE", "EVERY_ACCURACY", "Program", "conic_method", "method"]

Claim = tuple[Any, Outcome, str]
"""Return value of a method: an answer or None, the outcome that it claims, and the solver's
message.
"""


# --- programs and studies ---------------------------------------------------------------------


class Task(Checker):
    """A Program or a Study: its answer can be checked, stored and plotted.

    Its arrays cannot be changed: once it is made they are read-only views.
    """

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        own = vars(cls).get("__post_init__")
        if own is not None:

            @functools.wraps(own)
            def then_sealed(self: Task) -> None:
                own(self)
                Task.__post_init__(self)

            cls.__post_init__ = then_sealed  # type: ignore[method-assign]

    def __post_init__(self) -> None:
        """Make the arrays read-only; `dataclasses` calls this at the end of ``__init__``."""
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray) and value.flags.writeable:
                vars(self)[name] = read_only(value)

    headline: ClassVar[str] = ""
    """Name of the main metric of the task, which tables show."""

    relative_metrics: ClassVar[tuple[str, ...]] = ()
    """Metrics that are a ratio minus 1, or the logarithm of a ratio. Their rounding error is that
    of numbers near 1, however small the metric is.
    """

    checks_follow_accuracy: ClassVar[bool] = False
    """Whether limits of `checks` depend on the tolerance. Otherwise they are the same at every
    accuracy.
    """

    def of_stored(self, data: Dataset) -> Task:
        """The same question about the data in a results folder, which may differ by rounding.

        `verify` compares the two. Data that a problem computes differ in their last bits between
        processors. A Program whose checks do not tolerate that certifies the answer with the stored
        data.
        """
        return self

    @abstractmethod
    def metrics(self, answer: Any) -> dict[str, float]:
        """The numbers people quote."""

    def headline_value(self, answer: Any) -> float:
        return self.metrics(answer).get(self.headline, math.nan) if self.headline else math.nan

    def drawings(self, answer: Any) -> dict[str, Callable[[], Mapping[str, Figure]]]:
        """Functions that draw the figures, by name.

        If one fails, the others can still be called.
        """
        return {"figures": lambda: self.figures(answer)}

    def tables(self, answer: Any) -> dict[str, str]:
        """Tables in Markdown by file stem."""
        return {}

    def files(self, answer: Any) -> dict[str, str]:
        """Texts that are stored in the results folder beside the arrays, by file name."""
        return {}

    def to_dataset(self, answer: Any) -> Dataset:
        """Every array of question and answer, labelled and with units.

        An answer that is a dataset is stored as it is. A task with answers of another type must
        define this method and `from_dataset`; otherwise InputError is raised.
        """
        import xarray as xr

        if not isinstance(answer, xr.Dataset):
            raise InputError(
                f"{type(self).__name__} must define to_dataset and from_dataset: its answer is a "
                f"{type(answer).__name__}, not a Dataset"
            )
        return answer

    def from_dataset(self, data: Dataset) -> Any:
        """The answer, read back."""
        return data

    def stored_answer(self, name: str, answer: Any) -> dict[str, Any]:
        data = self.to_dataset(answer)
        renamed = data.rename({one: f"{name}_{one}" for one in _names(data)})
        return {str(one): array for one, array in renamed.variables.items()}

    def restored_answer(self, name: str, data: Dataset) -> Any:
        start = f"{name}_"
        own = {one: one.removeprefix(start) for one in _names(data) if one.startswith(start)}
        if not own:
            return None
        kept = data.drop_vars([one for one in data.variables if one not in own])
        return self.from_dataset(kept.rename({one: own[one] for one in _names(kept)}))

    @classmethod
    def answer_type(cls) -> str:
        """Name of its answers' type: the return annotation of `from_dataset`, or "Dataset"."""
        if cls.from_dataset is Task.from_dataset:
            return "Dataset"
        told = cls.from_dataset.__annotations__.get("return", "what from_dataset returns")
        return told if isinstance(told, str) else str(told.__name__)

    @abstractmethod
    def respond(self, method: str | None, context: Context) -> Claim:
        """A method's answer (None: the default method), the outcome that it claims, its message."""

    @abstractmethod
    def claims_optimum(self, method: str | None) -> bool:
        """Whether the method claims to find the optimum.

        Raises as `find_method` for an unknown method.
        """

    @abstractmethod
    def accuracy_range(self, method: str | None) -> AccuracyRange:
        """The tolerances that make a difference to the method's answer."""

    @abstractmethod
    def judging_tolerance(self, method: str | None, tolerance: float) -> float:
        """The tolerance of the certificate; it belongs to the question, and so to its key."""

    def unheeded(self, method: str | None, tolerance: float) -> str:
        """A note to the user if the method ignores the tolerance that was asked for.

        Otherwise empty.

        For the default tolerance there is no note.
        """
        accuracies = self.accuracy_range(method)
        heeded = not accuracies.none and accuracies.served(tolerance) == tolerance
        if heeded or tolerance == DEFAULT_TOLERANCE:
            return ""
        held = "; only the gap is held to it" if self.claims_optimum(method) else ""
        return f"tolerance {tolerance:.2g} is not heeded: {accuracies.words}{held}"

    def claim_task(self, claim: Outcome) -> Task | None:
        """The task whose answer proves the claim that the problem is infeasible or unbounded.

        None if no such proof is known; then the claim counts for nothing.
        """
        return None


class ProofTask(Task):
    """A task whose answer proves a claim that there is no answer; it has no choice of method."""

    def claims_optimum(self, method: str | None) -> bool:
        return False

    def accuracy_range(self, method: str | None) -> AccuracyRange:
        return ANY_ACCURACY_ALIKE

    def judging_tolerance(self, method: str | None, tolerance: float) -> float:
        return ANY_ACCURACY_ALIKE.served(tolerance)


class Program(Task):
    """One family of optimisation problems.

    Its subclasses are frozen dataclasses that hold the data.
    """

    default_method: ClassVar[str]
    methods_in: ClassVar[tuple[str, ...]] = ()
    """Further modules that define its methods; they are imported when the methods are needed."""

    # --- what a comparison of methods reads -------------------------------------------------------

    @property
    def problem_size(self) -> float | None:
        """Size of the problem for timing plots: a number of variables or of data.

        A Program that overrides this says in its docstring what is counted. None: no size is
        defined.
        """
        return None

    def objective(self, answer: Any) -> float | None:
        """The value of the objective that the methods minimise, at a valid answer.

        None without an objective.

        A quantity to be maximised is returned with its sign changed. A batch of independent
        problems returns one number, such as the sum of their objectives.
        """
        return None

    def objective_scale(self, answer: Any) -> float:
        """The scale that makes the optimality gap and differences of the objective relative."""
        return abs(self.objective(answer) or 0.0)

    def objective_rounding(self, answer: Any) -> float:
        """Absolute difference of the objective that rounding alone can cause."""
        return 0.0

    def lower_bound(self, answer: Any, gap: float) -> float | None:
        """Lower bound on the optimal objective that the gap of a valid answer proves.

        It is objective - gap * scale - rounding, rounded downward. None if the Program has no
        objective.
        """
        objective = self.objective(answer)
        if objective is None:
            return None
        distance = gap * self.objective_scale(answer)
        arithmetic = 4 * sys.float_info.epsilon * (abs(objective) + abs(distance))
        return objective - distance - self.objective_rounding(answer) - arithmetic

    # --- its methods ------------------------------------------------------------------------------

    def respond(self, method: str | None, context: Context) -> Claim:
        chosen = find_method(self, method)
        claim = chosen.answer(self, context)
        match claim:
            case (_, Outcome(), str()):
                return claim
        raise SolverError(
            f"method {chosen.name!r} of {type(self).__name__} returned {_described(claim)}; "
            f"it must return three things: its answer ({self.answer_type()}) or None, an Outcome "
            "such as Outcome.SOLVED, and a text, which may be empty"
        )

    def claims_optimum(self, method: str | None) -> bool:
        return find_method(self, method).optimal

    def accuracy_range(self, method: str | None) -> AccuracyRange:
        return find_method(self, method).accuracy

    def judging_tolerance(self, method: str | None, tolerance: float) -> float:
        return find_method(self, method).judging_tolerance(tolerance)


def _described(value: Any) -> str:
    """A short description of a value: None, (float, float), Dataset."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_described, value))})"
    return "None" if value is None else type(value).__name__


# --- methods ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Method:
    """A function that answers a Program.

    ``optimal`` tells whether it claims to find the optimum; ``unfit`` returns the reason why it
    cannot take a program, or None; ``accuracy`` is the range of tolerances that make a difference
    to it; ``packages`` lists those that it uses without importing them by name. ``by_name``: an
    independent answer that is never the best, which a comparison of all methods leaves out.
    """

    name: str
    answer: Callable[[Any, Context], Claim]
    optimal: bool
    unfit: Callable[[Any], str | None]
    help: str
    accuracy: AccuracyRange = EVERY_ACCURACY
    packages: tuple[str, ...] = ()
    by_name: bool = False

    def judging_tolerance(self, tolerance: float) -> float:
        """The tolerance of the certificate.

        It is the tolerance asked for if the method claims the optimum, since the gap must close to
        that tolerance; otherwise the nearest one that makes a difference to the method.
        """
        return tolerance if self.optimal else self.accuracy.served(tolerance)


_METHODS: dict[type[Program], dict[str, Method]] = {}


def _always_fit(program: Program) -> None:
    return None


def method(
    program: type[Program],
    name: str,
    *,
    optimal: bool,
    unfit: Callable[[Any], str | None] = _always_fit,
    accuracy: AccuracyRange = EVERY_ACCURACY,
    packages: tuple[str, ...] = (),
    by_name: bool = False,
) -> Callable[[Callable[[Any, Context], Claim]], Callable[[Any, Context], Claim]]:
    """Register ``function(program, context)`` as a method; its docstring is the method's help.

    Tolerances outside ``accuracy`` are never passed to the function. ``packages`` are those that it
    uses without an import that names them; the question's key includes their versions. With
    ``by_name`` a comparison asks the method only if it is named: its file says why.

    A subclass may have its own method under a name of its base class. Defining a function again (by
    importing its file or running its notebook cell again) replaces it.

    Raises
    ------
    RegistryError
        Another function is registered on this Program under the same name.
    """

    def register(function: Callable[[Any, Context], Claim]) -> Callable[[Any, Context], Claim]:
        text = (function.__doc__ or "").strip().partition("\n")[0]
        registered = _METHODS.setdefault(program, {})
        if name in registered and not _is_replaced(registered[name].answer, function):
            raise RegistryError(
                f"two methods of {program.__name__} are called {name!r}: "
                f"{_source(registered[name].answer)} and {_source(function)}; give one of them "
                "another name"
            )
        registered[name] = Method(name, function, optimal, unfit, text, accuracy, packages, by_name)
        return function

    return register


def is_registered(program: str, name: str) -> bool:
    """Whether a Program class of this name, or a subclass of it, has a method of this name here."""
    return any(name in methods(kind) for kind in _kinds(Program) if kind.__name__ == program)


def _kinds(program: type[Any]) -> list[type[Program]]:
    """A Program class and all its subclasses that this process has imported."""
    return [program, *(one for below in program.__subclasses__() for one in _kinds(below))]


def _is_replaced(old: Callable[..., Any], new: Callable[..., Any]) -> bool:
    """Whether a function is an earlier definition of another, or comes from an outdated module."""
    module = sys.modules.get(getattr(old, "__module__", ""))
    if module is None or vars(module) is not getattr(inspect.unwrap(old), "__globals__", None):
        return True
    same_name = getattr(old, "__qualname__", "") == getattr(new, "__qualname__", "")
    same_module = getattr(old, "__module__", "") == getattr(new, "__module__", "")
    return same_name and (same_module or _file(old) == _file(new))


def _file(function: Callable[..., Any]) -> str:
    code = getattr(inspect.unwrap(function), "__code__", None)
    return code.co_filename if code else ""


def _source(function: Callable[..., Any]) -> str:
    """Name, file and line of a function."""
    code = getattr(inspect.unwrap(function), "__code__", None)
    name = getattr(function, "__qualname__", repr(function))
    return f"{name} ({code.co_filename}:{code.co_firstlineno})" if code else name


def conic_method(
    program: type[Program],
    *,
    optimal: bool = True,
    unfit: Callable[[Any], str | None] = _always_fit,
    accuracy: AccuracyRange = EVERY_ACCURACY,
    cones: str | Callable[[Any], str] = "semidefinite",
) -> Callable[..., Any]:
    """Register ``function(program, context, solver)`` once for every conic solver.

    ``optimal`` is false if only a part of the program is convex. No method is more accurate than
    its solver. ``cones``: the most general of `workbench.solvers.CONES` that the program uses, or a
    function of the program that returns it; solvers that cannot handle it are unfit.
    """

    def register(
        function: Callable[[Any, Context, ConicSolver], Claim],
    ) -> Callable[[Any, Context, ConicSolver], Claim]:
        def told(solver: ConicSolver) -> None:
            @functools.wraps(function)
            def with_solver(program: Any, context: Context) -> Claim:
                return function(program, context, solver)

            def not_taken(task: Any) -> str | None:
                widest = cones if isinstance(cones, str) else cones(task)
                return unfit(task) or solver.unfit(widest) or None

            method(
                program,
                solver.name,
                optimal=optimal,
                unfit=not_taken,
                accuracy=accuracy.joined(solver.finest),
                packages=(solver.package or solver.module,),
            )(with_solver)

        for_every_conic_solver(told)
        return function

    return register


def methods(program: Program | type[Program]) -> dict[str, Method]:
    """The methods registered on a Program, by name."""
    cls = program if isinstance(program, type) else type(program)
    for base in reversed(cls.__mro__):
        for module in vars(base).get("methods_in", ()):
            importlib.import_module(module)
    return {
        name: entry
        for base in reversed(cls.__mro__)
        for name, entry in _METHODS.get(base, {}).items()
    }


def find_method(program: Program, name: str | None) -> Method:
    """The method of that name (None: the default), fit for this program.

    Raises
    ------
    UnknownNameError
        No method of that name is registered on the Program.
    InputError
        The method cannot take this program; the message says why.
    """
    known = methods(program)
    if name is not None:
        need_kind(name, str, "the name of a method")
    name = name or program.default_method
    if name not in known:
        raise UnknownNameError(f"method of {type(program).__name__}", name, known)
    reason = known[name].unfit(program)
    if reason:
        raise InputError(f"method {name!r} cannot take this {type(program).__name__}: {reason}")
    return known[name]


def _names(data: Dataset) -> list[str]:
    """Names of the variables and dimensions of a dataset."""
    return sorted({*map(str, data.variables), *map(str, data.sizes)})
