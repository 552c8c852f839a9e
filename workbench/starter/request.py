"""What a study is asked for, checked before its records are read."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from workbench.errors import InputError
from workbench.input_checks import is_real, need_positive
from workbench.starter.first_choices import BENT, CONFIDENCE
from workbench.synthesis import WorkingPoint
from workbench.synthesis.demands.demands import Demands
from workbench.synthesis.implementation.working_point.actuator import actuator
from workbench.uncertainty.responses.measured import found_files

Choices = TypeVar("Choices", bound=Any)
"""A dataclass of numbers with a dictionary ``reasons``."""


@dataclass(frozen=True)
class Request:
    """A folder, records and numbers that a study may have.

    ``record_dt``, ``dt``: sampling times [s] of records without a time column and of the
    controller's computer. ``limits``: of the inputs, absolute; None: those in the records.
    """

    target: Path
    paths: list[Path]
    demands: dict[str, Any]
    record_dt: float | None
    dt: float | None
    delay_samples: float
    limits: Any

    @classmethod
    def checked(
        cls,
        folder: str | Path,
        data: str | Sequence[str],
        demands: dict[str, Any],
        *,
        record_dt: float | None,
        dt: float | None,
        delay_samples: float,
        limits: Any,
        **positive: float | None,
    ) -> Request:
        """The request; raises InputError for numbers, a folder or files that cannot be meant."""
        Demands(**demands, noise=1.0)  # raises for invalid numbers
        for name, number in (positive | {"dt": dt, "record_dt": record_dt}).items():
            need_positive(number, name, or_none=True)
        if not (is_real(delay_samples) and 0.0 <= delay_samples < math.inf):
            raise InputError(
                f"delay_samples is {delay_samples!r}; it must be a number of samples, 0 or more"
            )
        target, paths = _new_folder(folder), _distinct_files(data)
        return cls(target, paths, demands, record_dt, dt, delay_samples, limits)

    def words(self, period: float, point: WorkingPoint, limits: tuple[Any, Any]) -> dict[str, Any]:
        """What the templates of every study say, with the records' sampling time and limits.

        Raises InputError if the limits do not fit the working point.
        """
        period = period if self.dt is None else self.dt
        actuator(limits, None, point, (len(point.y), len(point.u)), period)
        sides = [np.asarray(side, dtype=float).tolist() for side in limits]
        return {
            "plant": self.target.name,
            "package": self.target.name.lower().replace("-", "_"),
            "record_dt": self.record_dt,
            "point": point,
            "period": period,
            "delay_samples": self.delay_samples,
            "limits": tuple(tuple(side) if isinstance(side, list) else side for side in sides),
            "limits_from": "of the records" if self.limits is None else "as given",
            "confidence": CONFIDENCE,
            "bent": BENT,
        }


def present(values: Mapping[str, Any]) -> dict[str, Any]:
    """The entries that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def with_given(chosen: Choices, given: Mapping[str, Any]) -> Choices:
    """Choices with the numbers that are given, if not None, in the place of those found."""
    numbers = present(given)
    return replace(chosen, reasons=chosen.reasons | dict.fromkeys(numbers, "as given"), **numbers)


def _new_folder(folder: str | Path) -> Path:
    """The folder, which must not exist yet, and whose name must be one of a plant."""
    target = Path(folder)
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", target.name):
        raise InputError(
            f"{target.name!r} names the plant and its problems: letters, digits, - and _, a letter "
            "first"
        )
    if target.exists():
        raise InputError(f"{target} exists already; name a new folder, or move it away")
    return target


def _distinct_files(data: str | Sequence[str]) -> list[Path]:
    """The files of the records, which go into one folder."""
    paths = found_files(data)
    if len({path.name for path in paths}) < len(paths):
        raise InputError("two files have one name; they would take each other's place: rename one")
    return paths
