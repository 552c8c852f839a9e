"""Sampling times: of one system, and of several that are used together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from workbench.errors import InputError


def need_sampling_time(dt: Any, name: str) -> None:
    """Raise InputError for python-control's ``dt=True``: sampled, at a time that is not known."""
    if dt is True:
        raise InputError(
            f"{name} is sampled, but its sampling time is not given (dt=True): give it in seconds, "
            "as in control.ss(A, B, C, D, 0.01)"
        )


def common_time_base(times: Iterable[Any]) -> float | bool | None:
    """The sampling time [s] of systems together, by the rules of python-control.

    None fits every time, and True (sampled at an unknown time) every time but 0. Raises InputError
    for times that do not fit each other.
    """
    # a list, since a set holds True and 1.0 as one
    given = [True if dt is True else float(dt) for dt in times if dt is not None]
    numbers = {dt for dt in given if dt is not True}
    unknown = any(dt is True for dt in given)
    if len(numbers) > 1 or (unknown and 0.0 in numbers):
        told = ["0 (continuous)" if dt == 0.0 else f"{dt:g} s" for dt in sorted(numbers)]
        told += ["True (sampled at an unknown time)"] * unknown
        raise InputError(
            f"systems with dt = {' and '.join(told)} cannot be combined: give all of them one, by "
            "discretise, sampled_model or continuous_controller"
        )
    if numbers:
        return numbers.pop()
    return True if unknown else None
