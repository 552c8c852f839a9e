"""Checks of a Study, declared: a statement, a limit, and the array that must not exceed it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np

from workbench.certificate import Check, quantified_checks
from workbench.errors import InputError
from workbench.study.declarations import Declaration, Function

Limit = float | Mapping[str, float]


class Checked(Declaration):
    """Values that may not exceed a limit; one check for each label of the dimensions ``each``."""

    def __init__(
        self,
        function: Function,
        title: str,
        statement: str,
        at_most: Limit | Callable[[Any], Limit] | None,
        each: tuple[str, ...],
        where: str,
        over: str | Callable[[Any], str],
    ) -> None:
        super().__init__(function)
        self.title, self.statement, self.at_most = title, statement, at_most
        self.each, self.where, self.over = each, where, over

    def checks(self, study: Any, get: Callable[[str], Any]) -> Iterator[Check]:
        value = self.value(study, get)
        if value is None:
            return
        over = self.over(study) if callable(self.over) else self.over
        if isinstance(value, list):  # the function returned checks itself
            yield from quantified_checks(over, value)
            return
        limit = self.at_most(study) if callable(self.at_most) else self.at_most
        if limit is None:
            raise InputError(f"check {self.name!r} of {type(study).__name__} needs at_most=...")
        title = self.title or self.name.replace("_", " ")
        statement = self.statement or self.help
        for labels, one in _split(value, self.each):
            size, where = _worst(one, self.where)
            most = limit[labels[self.each[0]]] if isinstance(limit, Mapping) else limit
            name, words = title.format(**labels), statement.format(**labels)
            yield Check(name, words, size, most, where=where, over=over.format(**labels))


def check(
    *,
    title: str = "",
    statement: str = "",
    value: Function | None = None,
    at_most: Limit | Callable[[Any], Limit] | None = None,
    each: str | tuple[str, ...] = (),
    where: str = "",
    over: str | Callable[[Any], str] = "",
) -> Any:
    """Declare a check: a function of stored arrays whose value may not exceed ``at_most``.

    The function returns a number; a number and its place in words; an array, whose largest value
    counts (NaN counts as largest); None if there is nothing to check; or a list of `Check`.

    Parameters
    ----------
    title, statement
        Default: the function's name, and the first line of its docstring. With ``each``, both may
        name the labels, as in ``"{axis} resonance"``.
    value
        The function; if it is left out, this is a decorator.
    at_most
        The limit; or limits by the labels of the first of ``each``; or a function of the Study that
        returns either. A list of `Check` has its own limits.
    each
        Dimensions of the array that get one check for each label.
    where
        Format of the place of the largest value, as in ``"of {drive} at {frequency:.4g}"``, with
        units. Default: the labels of all its dimensions.
    over
        What the statement quantifies over, such as "at the 400 frequencies, for these 12 drives";
        it may name the labels too, or be a function of the Study.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from workbench import Study, solve
    >>> from workbench.study import array, check, dim
    >>> @dataclass(frozen=True)
    ... class Squares(Study):
    ...     '''Squares of some numbers.'''
    ...
    ...     number = dim(1, 2, 3)
    ...     square = array(dims=number, unit="1", meaning="square", value=lambda number: number**2)
    ...     small = check(
    ...         title="small", statement="the largest square", value=lambda square: square,
    ...         at_most=8.0
    ...     )
    ...
    >>> certificate = solve(Squares()).certificate
    >>> certificate.holds, certificate.checks[0].value, certificate.checks[0].where
    (False, 9.0, 'at number 3')
    """
    names = (each,) if isinstance(each, str) else each
    if value is not None:
        return Checked(value, title, statement, at_most, names, where, over)
    return lambda function: Checked(function, title, statement, at_most, names, where, over)


def _split(value: Any, each: tuple[str, ...]) -> Iterator[tuple[dict[str, Any], Any]]:
    if not each:
        yield {}, value
        return
    for labels in product(*(value[name].values.tolist() for name in each)):
        place = dict(zip(each, labels, strict=True))
        yield place, value.sel(place)


def _worst(value: Any, where: str) -> tuple[float, str]:
    """The largest value and where it is."""
    if isinstance(value, tuple):
        return float(value[0]), str(value[1])
    if not hasattr(value, "dims") or not value.dims:
        return float(value), where
    values = np.asarray(value.values, dtype=float)
    place = np.unravel_index(
        int(np.argmax(np.where(np.isnan(values), math.inf, values))), values.shape
    )
    at = value[place]
    labels = {name: _Label(at[name]) for name in value.dims if name in at.coords}
    words = where.format(**labels) if where else ", ".join(f"{k} {v}" for k, v in labels.items())
    return float(values[place]), words if where or not words else f"at {words}"


class _Label:
    """A coordinate in words: its value, in a format if one is given, and its unit."""

    def __init__(self, coordinate: Any) -> None:
        self.value, self.unit = coordinate.values.item(), coordinate.attrs.get("units", "")

    def __format__(self, form: str) -> str:
        text = format(self.value, form or (".6g" if isinstance(self.value, float) else ""))
        return f"{text} {self.unit}" if self.unit else text
