"""The one idea.

A `Program` is one family of optimisation problems: its data and a check of any answer.
A *method* is anything that answers a Program; it is never believed.
A `Certificate` says what was checked from the data alone, and by how much it holds.
A `Study` (see `workbench.study`) has no method to choose: arrays with checks of its own.
"""

from __future__ import annotations

import functools
import inspect
import math
import sys
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench.errors import InputError, RegistryError, TimeLimitError, UnknownNameError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.solvers import ConicSolver, Options, Outcome, conic_solvers

# --- certificates -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Check:
    """One statement that must hold: a measured value that may not exceed a limit.

    ``where`` names the place of the worst value, for instance a frequency.
    """

    name: str
    statement: str
    value: float
    limit: float
    where: str = ""

    @property
    def margin(self) -> float:
        """Limit less value: negative where the check fails, NaN where the value is NaN."""
        return self.limit - self.value

    @property
    def holds(self) -> bool:
        return self.value <= self.limit  # false for NaN


@dataclass(frozen=True)
class Gap:
    """How far an answer may be from the best one, by a bound that no method supplied."""

    statement: str
    value: float
    tolerance: float
    required: bool

    @property
    def closed(self) -> bool:
        return abs(self.value) <= self.tolerance  # an answer beyond its bound is wrong, or it is


@dataclass(frozen=True, repr=False)
class Certificate:
    """Validity checks, which must hold, and where there is one the optimality gap."""

    checks: tuple[Check, ...]
    gap: Gap | None = None

    @property
    def valid(self) -> bool:
        return all(check.holds for check in self.checks)

    @property
    def holds(self) -> bool:
        """Valid, and as good as the method claims."""
        return self.valid and (self.gap is None or not self.gap.required or self.gap.closed)

    @property
    def outcome(self) -> Outcome:
        """Solved, or inaccurate where only the optimum is missed, or failed."""
        if self.holds:
            return Outcome.SOLVED
        return Outcome.INACCURATE if self.valid else Outcome.FAILED

    @property
    def failures(self) -> tuple[str, ...]:
        """A sentence for each thing that does not hold."""
        failed = [
            f"{check.name}: {check.value:.6g} exceeds {check.limit:.6g}"
            + (f" {check.where}" if check.where else "")
            for check in self.checks
            if not check.holds
        ]
        if self.gap is not None and self.gap.required and not self.gap.closed:
            failed.append(f"optimality gap: {self.gap.value:.3g} exceeds {self.gap.tolerance:.3g}")
        return tuple(failed)

    def __repr__(self) -> str:
        lines = [f"Certificate: {self.outcome}"]
        lines += [
            f"  {'holds' if c.holds else 'FAILS'}  {c.name}: {c.value:.6g} <= {c.limit:.6g} "
            f"{c.where}".rstrip()
            for c in self.checks
        ]
        if self.gap is not None:
            needed = "required" if self.gap.required else "not claimed"
            lines.append(f"  gap {self.gap.value:.3g}, {needed} within {self.gap.tolerance:.3g}")
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        checks = [asdict(check) | {"holds": check.holds} for check in self.checks]
        gap = None if self.gap is None else asdict(self.gap) | {"closed": self.gap.closed}
        return {"holds": self.holds, "valid": self.valid, "checks": checks, "gap": gap}

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> Certificate:
        gap = stored["gap"]
        return cls(
            tuple(Check(**_read(check, "holds")) for check in stored["checks"]),
            gap and Gap(**_read(gap, "closed")),
        )


def _read(stored: Mapping[str, Any], derived: str) -> dict[str, Any]:
    """Fields from JSON, which has NaN and infinities as their names; ``derived`` is left out."""
    numbers = {"value", "limit", "tolerance"}
    return {
        k: float(v) if k in numbers and isinstance(v, str) else v
        for k, v in stored.items()
        if k != derived
    }


Claim = tuple[Any, Outcome, str]
"""Return value of a method: an answer or None, its outcome by the method, the solver's message."""


# --- programs and studies ---------------------------------------------------------------------


class Task(ABC):
    """A Program or a Study: its answer can be checked, stored and shown."""

    headline: ClassVar[str] = ""
    """The metric that stands for the task in tables."""

    @abstractmethod
    def checks(self, answer: Any, tolerance: float) -> Sequence[Check]:
        """Validity checks of an answer from the data alone, sharing no code with any method."""

    def gap(self, answer: Any) -> tuple[str, float] | None:
        """Relative optimality gap by an independent bound, and what it says; None without one."""
        return None

    @abstractmethod
    def metrics(self, answer: Any) -> dict[str, float]:
        """The numbers people quote."""

    def figures(self, answer: Any) -> dict[str, Figure]:
        """Figures by file stem; returned, never written."""
        return {}

    def tables(self, answer: Any) -> dict[str, str]:
        """Tables in Markdown by file stem."""
        return {}

    def to_dataset(self, answer: Any) -> Dataset:
        """Every array of question and answer, labelled, with units.

        An answer that is a dataset is stored as it is. A task with answers of another type defines
        this method and `from_dataset`; without them InputError is raised.
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

    @abstractmethod
    def respond(self, method: str | None, context: Context) -> Claim:
        """An answer by a method (None: the default one), what is said of it, and in what words."""

    @abstractmethod
    def claims_optimum(self, method: str | None) -> bool:
        """Whether the method claims the best answer; raises as `find_method` for an unknown one."""

    def certify(self, answer: Any, tolerance: float, *, optimal: bool = False) -> Certificate:
        """Certificate of an answer; ``optimal`` when whoever gave it claims it is the best."""
        with np.errstate(all="ignore"):  # a wrong answer may make NaN of a check, which fails it
            checks = tuple(self.checks(answer, tolerance))
            gap = self.gap(answer)
        return Certificate(checks, gap and Gap(gap[0], gap[1], tolerance, required=optimal))


class Program(Task):
    """One family of optimisation problems. Subclasses are frozen dataclasses of its data."""

    default_method: ClassVar[str]

    def respond(self, method: str | None, context: Context) -> Claim:
        return find_method(self, method).answer(self, context)

    def claims_optimum(self, method: str | None) -> bool:
        return find_method(self, method).optimal


# --- methods ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Method:
    """Anything that answers a Program.

    ``optimal`` says that it claims the best answer; ``unfit`` returns the reason why it cannot
    take a program, or None.
    """

    name: str
    answer: Callable[[Any, Context], Claim]
    optimal: bool
    unfit: Callable[[Any], str | None]
    help: str


_METHODS: dict[type[Program], dict[str, Method]] = {}


def _always_fit(program: Program) -> None:
    return None


def method(
    program: type[Program],
    name: str,
    *,
    optimal: bool,
    unfit: Callable[[Any], str | None] = _always_fit,
) -> Callable[[Callable[[Any, Context], Claim]], Callable[[Any, Context], Claim]]:
    """Register ``function(program, context)`` as a method; its docstring is the method's help.

    A subclass may have a method of its own under a name of its base class. A function that is
    defined again (its file imported anew, its notebook cell run again) takes its former place.

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
        registered[name] = Method(name, function, optimal, unfit, text)
        return function

    return register


def _is_replaced(old: Callable[..., Any], new: Callable[..., Any]) -> bool:
    """Whether a function is an older version of another, or its module was imported anew since."""
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
) -> Callable[..., Any]:
    """Register ``function(program, context, solver)`` once for every installed conic solver.

    ``optimal`` is false where what is convex is only a part of the program.
    """

    def register(
        function: Callable[[Any, Context, ConicSolver], Claim],
    ) -> Callable[[Any, Context, ConicSolver], Claim]:
        for solver in conic_solvers():

            @functools.wraps(function)
            def with_solver(program: Any, context: Context, solver: ConicSolver = solver) -> Claim:
                return function(program, context, solver)

            method(program, solver.name, optimal=optimal, unfit=unfit)(with_solver)
        return function

    return register


def methods(program: Program | type[Program]) -> dict[str, Method]:
    """The methods registered on a Program, by name."""
    cls = program if isinstance(program, type) else type(program)
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
    name = name or program.default_method
    if name not in known:
        raise UnknownNameError(f"method of {type(program).__name__}", name, known)
    reason = known[name].unfit(program)
    if reason:
        raise InputError(f"method {name!r} cannot take this {type(program).__name__}: {reason}")
    return known[name]


# --- the verb ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Solution:
    """An answer, what its method claimed, and what the certificate says."""

    answer: Any
    claim: Outcome
    message: str
    certificate: Certificate | None
    seconds: Mapping[str, float] = field(default_factory=dict)
    trace: str = ""

    @property
    def outcome(self) -> Outcome:
        """Set by the certificate, whatever the method said.

        But a valid answer of a method that the clock stopped is no more than its best so far,
        unless the gap shows that there is no better one.
        """
        if self.certificate is None:
            claims_an_answer = self.claim in (Outcome.SOLVED, Outcome.INACCURATE)
            return Outcome.FAILED if claims_an_answer else self.claim
        gap = self.certificate.gap
        best = gap is not None and gap.closed
        if self.claim is Outcome.TIME_LIMIT and self.certificate.valid and not best:
            return Outcome.TIME_LIMIT
        return self.certificate.outcome


def solve(
    task: Task,
    method: str | None = None,
    options: Options | None = None,
    context: Context | None = None,
) -> Solution:
    """Answer a Program by a method (or compute a Study) and certify the answer.

    Foreign exceptions do not leak: a method that raises one has failed, with its words as message.

    Raises
    ------
    UnknownNameError, InputError
        As `find_method`; or a method was named for a Study, which has none.
    """
    context = context or Context(options or Options())
    if not isinstance(task, Task):
        raise InputError(f"a Program or a Study is needed, not {type(task).__name__}")
    optimal = task.claims_optimum(method)

    trace = ""
    start = time.perf_counter()
    try:
        answer, claim, message = task.respond(method, context)
    except TimeLimitError as error:
        answer, claim, message = None, Outcome.TIME_LIMIT, str(error)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a Rust panic is no Exception
        answer, claim, message = None, Outcome.FAILED, f"{type(error).__name__}: {error}"
        trace = traceback.format_exc()
    total = time.perf_counter() - start
    if answer is not None and context.stopped:
        claim, message = Outcome.TIME_LIMIT, context.stopped
    # Whatever was not booked as statement is solve: a method without a statement books nothing.
    stated = context.statement_seconds
    seconds = {"statement": stated, "solve": total - stated}
    if answer is None:
        return Solution(None, claim, message, None, seconds, trace)

    start = time.perf_counter()
    optimal = optimal and claim is not Outcome.TIME_LIMIT
    try:
        certificate = task.certify(answer, context.options.accuracy, optimal=optimal)
    except Exception as error:
        reason = f"the answer cannot be checked: {type(error).__name__}: {error}"
        message = f"{reason}; the method said: {message}" if message else reason
        return Solution(None, claim, message, None, seconds, traceback.format_exc())
    seconds["check"] = time.perf_counter() - start
    return Solution(answer, claim, message, certificate, seconds)


def worst(values: Any, labels: Callable[[tuple[int, ...]], str]) -> tuple[float, str]:
    """The largest of an array of values (NaN counts as largest) and the label of its place."""
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.size == 0:
        return 0.0, ""
    place = np.unravel_index(
        int(np.argmax(np.where(np.isnan(values), math.inf, values))), values.shape
    )
    return float(values[place]), labels(tuple(int(i) for i in place))
