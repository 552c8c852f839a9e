"""Spoils of what an answer stores, and what they show of each stored variable."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.accuracy import DEFAULT_TOLERANCE
from workbench.errors import WorkbenchError
from workbench.program import Program

Array = np.ndarray


def one_entry(values: Array) -> Array:
    """The largest entry larger by a quarter, the others as they are."""
    spoilt = values.copy()
    place = np.unravel_index(int(np.argmax(np.abs(np.nan_to_num(values)))), values.shape)
    spoilt[place] = spoilt[place] * 1.25
    return spoilt


def exchanged(values: Array) -> Array:
    """Each entry in the place of its neighbour, along the longest dimension."""
    return np.roll(values, 1, int(np.argmax(values.shape))) if values.ndim else values


SPOILS: dict[str, Callable[[Array], Array]] = {
    "times 0.8": lambda values: values * 0.8,
    "times 1.25": lambda values: values * 1.25,
    "times -1": lambda values: -values,
    "shifted": lambda values: values + 0.1 * max(float(np.abs(np.nan_to_num(values)).max()), 1e-3),
    "one entry": one_entry,
    "exchanged": exchanged,
}


@dataclass
class Found:
    """What the spoils of one stored variable showed."""

    caught: list[str] = field(default_factory=list)
    passed: list[str] = field(default_factory=list)
    numbers: set[str] = field(default_factory=set)
    """Metrics, tables and files that an unnoticed spoil changed."""
    raised: bool = True
    lowered: bool = True
    """Whether every unnoticed spoil made all of its entries larger, or smaller, or left them."""


def spoilt(
    program: Program,
    answer: Any,
    method: str | None = None,
    wanted: Callable[[str], bool] = lambda name: True,
) -> dict[str, Found]:
    """What each spoil of each stored variable leads to; variables of the question are left out.

    These are stored to be read: the answer that is restored has the question's own.
    """
    optimal = program.claims_optimum(method)
    tolerance = program.judging_tolerance(method, DEFAULT_TOLERANCE)
    data = program.to_dataset(answer)
    numbers = leaving(program, program.from_dataset(data))
    found: dict[str, Found] = {}
    for name, variable in data.variables.items():
        if variable.dtype.kind not in "fci" or not variable.size or not wanted(str(name)):
            continue
        for word, values in _changed(variable.values):
            changed = data.copy(deep=True)
            changed[name] = (variable.dims, values, variable.attrs)
            try:
                with np.errstate(all="ignore"):
                    other = program.from_dataset(changed)
                    again = program.to_dataset(other)
                    if name not in again or _same(again[name].values, variable.values):
                        continue
                    holds = program.certify(other, tolerance, optimal=optimal).holds
                    after = leaving(program, other) if holds else {}
            except (WorkbenchError, ValueError, ArithmeticError, np.linalg.LinAlgError):
                holds, after = False, {}
            one = found.setdefault(str(name), Found())
            if not holds:
                one.caught.append(word)
                continue
            one.passed.append(word)
            one.numbers |= {key for key in numbers if not _same(numbers[key], after.get(key))}
            one.raised = one.raised and _ordered(variable.values, values)
            one.lowered = one.lowered and _ordered(values, variable.values)
    return found


def lost(program: Program, answer: Any, method: str | None = None) -> list[str]:
    """Stored variables whose NaN or infinity makes a check raise something that nobody names."""
    optimal = program.claims_optimum(method)
    data = program.to_dataset(answer)
    told = []
    for name, variable in data.variables.items():
        if variable.dtype.kind not in "fc" or not variable.size:
            continue
        for value, places in ((np.nan, np.s_[-1:]), (np.inf, np.s_[-1:]), (np.nan, np.s_[:])):
            values = variable.values.copy()
            values.flat[places] = value
            changed = data.copy(deep=True)
            changed[name] = (variable.dims, values, variable.attrs)
            try:
                with np.errstate(all="ignore"):
                    other = program.from_dataset(changed)
                program.certify(other, DEFAULT_TOLERANCE, optimal=optimal)
            except WorkbenchError:
                continue
            except Exception as error:
                told.append(f"{name}, {value}: {type(error).__name__}: {error}")
    return told


def own_variables(program: Program, answer: Any) -> set[str]:
    """Names of numeric variables that the restored answer has from the dataset."""
    data = program.to_dataset(answer)
    return {
        str(name)
        for name, variable in data.variables.items()
        if variable.dtype.kind in "fci" and variable.size and _is_read(program, data, name)
    }


def _is_read(program: Program, data: Any, name: Any) -> bool:
    """Whether a change of the variable changes the restored answer, or is refused."""
    for _, values in _changed(data[name].values):
        changed = data.copy(deep=True)
        changed[name] = (data[name].dims, values, data[name].attrs)
        try:
            with np.errstate(all="ignore"):
                again = program.to_dataset(program.from_dataset(changed))
        except (WorkbenchError, ValueError, ArithmeticError, np.linalg.LinAlgError):
            return True
        if name in again and not _same(again[name].values, data[name].values):
            return True
    return False


def leaving(program: Program, answer: Any) -> dict[str, Any]:
    """Numbers and texts that leave with an answer."""
    return program.metrics(answer) | program.tables(answer) | program.files(answer)


def _changed(values: Array) -> Iterator[tuple[str, Array]]:
    for word, spoil in SPOILS.items():
        with np.errstate(all="ignore"):
            other = spoil(values)
        if values.dtype.kind == "i":
            other = np.rint(other).astype(values.dtype)
        if not _same(other, values):
            yield word, other


def _ordered(low: Array, high: Array) -> bool:
    """Whether no entry of the first is larger than that of the second."""
    return not np.iscomplexobj(low) and not bool((np.nan_to_num(low) > np.nan_to_num(high)).any())


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, str) or isinstance(other, str) or other is None:
        return bool(one == other)
    one, other = np.asarray(one), np.asarray(other)
    return one.shape == other.shape and bool(np.allclose(one, other, 1e-9, 0.0, equal_nan=True))
