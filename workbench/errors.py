"""The workbench's own errors.

Every message says what was given, what is needed and, if something can be done, what to do.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from workbench._core.on_demand import no_more_names

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)


class WorkbenchError(Exception):
    """Base class of every error that the workbench raises on purpose.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.errors import WorkbenchError
    >>> try:
    ...     wb.load("no/such/problem")
    ... except WorkbenchError as error:
    ...     print(type(error).__name__)
    ...
    UnknownNameError
    """

    def __reduce__(self) -> tuple[Any, ...]:
        # An error is sent to another process by its message alone; the objects that made the
        # message stay.
        return _restored, (type(self), self.args, self.__dict__)


def _restored(
    kind: type[WorkbenchError], args: tuple[Any, ...], attributes: dict[str, Any]
) -> WorkbenchError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(attributes)
    return error


class InputError(WorkbenchError, ValueError):
    """Data or parameters that a task cannot use.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.errors import InputError
    >>> try:
    ...     wb.smallest_circle([])
    ... except InputError as error:
    ...     print(error)
    ...
    points of shape (0,) hold no point; needed is (..., N) with N >= 1
    """


class UnknownNameError(WorkbenchError, LookupError):
    """A name that is not registered; the message suggests the nearest ones.

    Examples
    --------
    >>> from workbench.errors import UnknownNameError
    >>> print(UnknownNameError("solver", "clarable", ["clarabel", "scs"]))
    no solver is called 'clarable'; did you mean clarabel?
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        near = _similar(str(name), known)
        more = f", and {len(known) - MOST_KNOWN} more" if len(known) > MOST_KNOWN else ""
        told = f"known: {', '.join(known[:MOST_KNOWN]) or '-'}{more}"
        hint = f"did you mean {' or '.join(near)}?" if near else told
        told = f"no {kind} is called {name!r}; {hint}"
        super().__init__(told.encode("utf-8", "backslashreplace").decode())


MOST_KNOWN = 20
"""Largest number of known names that a message lists."""
SIMILAR, BESIDE = 0.5, 0.1
"""Least similarity of a suggested name, and how much less similar than the nearest name
it may be.
"""


def _similar(name: str, known: list[str]) -> list[str]:
    """At most three known names: those that contain this one between slashes, else similar ones."""
    holding = [one for one in known if f"/{name}/" in f"/{one}/"]
    if holding:
        return holding[:3]
    near = difflib.get_close_matches(name, known, n=3, cutoff=SIMILAR)
    likeness = [difflib.SequenceMatcher(None, one, name).ratio() for one in near]
    return [one for one, like in zip(near, likeness, strict=True) if like > likeness[0] - BESIDE]


class RegistryError(WorkbenchError):
    """Problem files that contradict each other: duplicate names, cyclic needs, no literal name.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.errors import RegistryError
    >>> issubclass(RegistryError, wb.errors.WorkbenchError)
    True
    """


class ContradictionError(WorkbenchError):
    """Two bounds on the same quantity that contradict each other: one of their proofs is wrong.

    Parameters
    ----------
    what
        The quantity, and where it is bounded.
    lower, upper
        The bounds; the lower one is above the upper one.
    lower_claim, upper_claim
        The argument on which each bound rests.

    Examples
    --------
    >>> from workbench.errors import ContradictionError
    >>> error = ContradictionError("peak of mu", 1.2, "a perturbation", 1.1, "multipliers")
    >>> print(str(error).partition(":")[0])
    two certificates contradict each other on peak of mu
    """

    def __init__(
        self, what: str, lower: float, lower_claim: str, upper: float, upper_claim: str
    ) -> None:
        self.lower, self.upper = lower, upper
        super().__init__(
            f"two certificates contradict each other on {what}: it is at least {lower!r}, because "
            f"{lower_claim}; and it is at most {upper!r}, because {upper_claim}. At least one of "
            "them is false; neither may be used"
        )


class SolverError(WorkbenchError):
    """A method that gave no answer; the message quotes the solver.

    Examples
    --------
    >>> import control
    >>> from workbench.errors import SolverError
    >>> from workbench.synthesis import hinf
    >>> G = control.ss(
    ...     [[-1.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    ... )
    >>> try:
    ...     hinf(G, measurements=1, controls=1, gamma=0.1)
    ... except SolverError as error:
    ...     print(type(error).__name__)
    ...
    SolverError
    """


class TimeLimitError(WorkbenchError):
    """A method that was stopped at its time limit.

    Examples
    --------
    >>> from workbench.errors import TimeLimitError, WorkbenchError
    >>> issubclass(TimeLimitError, WorkbenchError)
    True
    """


class MemoryLimitError(WorkbenchError):
    """A task whose process was killed because it took more memory than allowed.

    Examples
    --------
    >>> from workbench.errors import MemoryLimitError, WorkbenchError
    >>> issubclass(MemoryLimitError, WorkbenchError)
    True
    """


class CrashedError(WorkbenchError):
    """A task whose process died twice: by a signal, or by calling exit.

    Examples
    --------
    >>> import os
    >>> from workbench.errors import CrashedError
    >>> from workbench.executor import Workers
    >>> with Workers(count=1) as workers:
    ...     try:
    ...         workers.submit(os._exit, 1).result()
    ...     except CrashedError as error:
    ...         print(type(error).__name__)
    ...
    CrashedError
    """


class ClusterError(WorkbenchError):
    """A scheduler that does not answer or was lost, or a worker with different code.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.errors import ClusterError
    >>> try:
    ...     wb.connect("tcp://127.0.0.1:1")
    ... except ClusterError as error:
    ...     print(type(error).__name__)
    ...
    ClusterError
    """


class ResultError(WorkbenchError):
    """A results folder that cannot be read, or that lacks something.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.errors import ResultError
    >>> try:
    ...     wb.open_run("no-such-folder")
    ... except ResultError as error:
    ...     print(error)
    ...
    no-such-folder is no results folder: it has no run.json
    """


class RangeWarning(UserWarning):
    """Frequencies or times so far from a system's time scale that their unit may be wrong.

    Examples
    --------
    >>> import warnings
    >>> import control
    >>> from workbench.errors import RangeWarning
    >>> from workbench.mu import Full, Structure, frequency_sweep
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     sweep = frequency_sweep(
    ...         control.tf([12.0], [1.0, 12.0]), Structure([Full(1, 1)]), omega=[1e4, 1e6]
    ...     )
    >>> caught[0].category is RangeWarning
    True
    >>> print(str(caught[0].message).partition(" (")[0])
    all frequencies lie above 100 times the fastest pole: are they in Hz?
    """


def words_of(error: BaseException) -> str:
    """An error's type and message, in characters that any file can hold.

    Examples
    --------
    >>> from workbench.errors import words_of
    >>> words_of(ValueError("not a number"))
    'ValueError: not a number'
    """
    return f"{type(error).__name__}: {error}".encode("utf-8", "backslashreplace").decode()
