"""Lines of a text file, and errors that name the line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConeFactor, ConicForm
from workbench.errors import InputError


@dataclass
class Lines:
    """The lines of a file that hold text, without comments, one after the other.

    Raises
    ------
    InputError
        The file is missing or is not a text.
    """

    file: str | PathLike[str]
    comments: str
    number: int = field(default=0, init=False)
    """Number of the line that was read last, counted from 1."""

    def __post_init__(self) -> None:
        path = Path(self.file)
        if not path.is_file():
            raise InputError(f"{path}: there is no such file")
        try:
            self._texts = path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            raise InputError(f"{path} is no text") from None

    def following(self) -> str | None:
        """The next line; None at the end of the file."""
        while self.number < len(self._texts):
            text = self._texts[self.number].strip()
            self.number += 1
            if text and text[0] not in self.comments:
                return text
        return None

    def needed(self, what: str) -> str:
        text = self.following()
        if text is None:
            raise InputError(f"{self.file} ends at line {self.number}; needed is {what}")
        return text

    def error(self, reason: str) -> InputError:
        return InputError(f"{self.file}, line {self.number}: {reason}")

    def whole(self, text: str, what: str, least: int = 0) -> int:
        """A whole number that is not smaller than ``least``."""
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least:
            raise self.error(f"{what} must be a whole number from {least} on, not {text!r}")
        return value

    def place(self, text: str, count: int, what: str, first: int) -> int:
        """An index among ``count`` that the file counts from ``first``; returned counted from 0."""
        place = self.whole(text, what, first) - first
        if place >= count:
            raise self.error(f"{what} is {text}, there are {count}")
        return place

    def real(self, text: str, what: str) -> float:
        try:
            value = float(text.replace("D", "e").replace("d", "e"))
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(f"{what} must be a finite number, not {text!r}")
        return value


@dataclass
class Entries:
    """Entries of b - A x, collected one by one."""

    lines: Lines
    rows: dict[tuple[int, int], float] = field(default_factory=dict)
    """Coefficients of the slack b - A x by row and column."""
    constant: dict[int, float] = field(default_factory=dict)

    def put(self, row: int, column: int | None, value: float) -> None:
        """Set the coefficient of a variable in the slack, or its constant (``column`` None)."""
        taken = row in self.constant if column is None else (row, column) in self.rows
        if taken:
            raise self.lines.error("this entry was given before")
        if column is None:
            self.constant[row] = value
        else:
            self.rows[row, column] = value

    def form(self, c: RealArray, cones: Sequence[ConeFactor]) -> ConicForm:
        """The program that minimises c'x subject to this slack lying in the cones."""
        import numpy as np
        from scipy.sparse import csr_array

        count = sum(cone.rows for cone in cones)
        places = np.array(list(self.rows), dtype=int).reshape(-1, 2)
        values = -np.array(list(self.rows.values()), dtype=float)
        b = np.zeros(count)
        b[list(self.constant)] = list(self.constant.values())
        A = csr_array((values, (places[:, 0], places[:, 1])), shape=(count, len(c)))
        return ConicForm(c, A, b, tuple(cones))
