"""Declaration of a named problem.

A problem is a function whose signature is the problem's parameters and whose docstring is its
help::

    @problem("cd/{axis}/circles", axis=("focus", "radial"), data="data/drives.csv")
    def circles(axis: str, frequencies: int = 400):
        "First set of circles."
        return SmallestCircle(points=...)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

PLACEMENT = "__workbench_problem__"
RESERVED_PARAMETERS = frozenset(
    {"name", "pattern", "method", "methods", "tolerance", "accuracies", "time_limit", "verbose"}
    | {"seed", "fresh", "progress", "watch", "executor", "memory_limit", "repeat", "jobs"}
    | {"threads", "light", "slow", "over"}
)
"""Arguments of `workbench.run`, `compare` and `sweep`; no parameter may have one of these names."""


class Fed:
    """A stored run, as it is passed to a problem that needs it."""


@dataclass(frozen=True)
class Ref:
    """A reference to the result of a problem: its name, method (None: default), parameters."""

    name: str
    method: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)


def ref(name: str, *, method: str | None = None, **parameters: Any) -> Ref:
    """A reference to a result of another problem, for ``needs``."""
    return Ref(name, method, parameters)


Needs = Mapping[str, Ref | list[Ref]]


@dataclass(frozen=True)
class Settings:
    needs: Needs | Callable[..., Needs]
    data: tuple[str, ...]
    method: str | None
    added: tuple[str, ...] = ()


def problem(
    name: str,
    *,
    needs: Needs | Callable[..., Needs] | None = None,
    data: str | tuple[str, ...] = (),
    slow: bool = False,
    method: str | None = None,
    added: tuple[str, ...] = (),
    **axes: tuple[str, ...] | str | Callable[[], Iterable[str]],
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register a function as a named problem.

    Parameters
    ----------
    name
        Name, or a template over the axes, like ``"cd/{axis}/circles"``. Must be a literal.
    needs
        Results of other problems that it needs, by argument name: `ref` or a list of them, or a
        function of the parameters that returns such a mapping. Their certificates must hold.
    data
        Data files that the problem reads, relative to the plant's folder, which is the first folder
        below the problem folder, or that itself. Their contents enter the problem's key. A name may
        contain axes, such as ``"sdplib/{instance}.dat-s"``.
    slow
        The problem is left out of ``make reproduce``.
    method
        The method that answers if the user names none; None: the default one of its Program.
    added
        Parameters that the problem has got since results were stored. At its default such a
        parameter is left out of the problem's key, so that these results stay valid.
    axes
        The values of each axis in the name; they are passed as parameters. They may be given as a
        tuple, or by the name of a tuple in the same file. A file pattern with one star, such as
        ``"sdplib/*.dat-s"``, gives the texts that the star matches. A function in the same file,
        without arguments, returns the values; then the file is imported to list the problems.
    """

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        files = (data,) if isinstance(data, str) else data
        setattr(function, PLACEMENT, Settings(needs or {}, files, method, added))
        return function

    return register
