"""The question a run answers, and its key.

The key is a hash of the question, never of versions: the same question finds the same folder
everywhere. The code that answered is hashed apart (`workbench.bench.code`), to tell whether a
stored answer may be reused.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from workbench.solvers import Options

Keys = Mapping[str, str | list[str]]
CELL_DIGITS = 16
"""Length of a cell's key: of a hundred thousand keys of eight digits some would be the same."""
REPETITION = "repetition"
"""The option that makes a question a cell's."""


@dataclass(frozen=True)
class Question:
    """Everything that may change the answer, except the code."""

    problem: str
    parameters: Mapping[str, Any]
    data: Mapping[str, str]
    needs: Keys
    method: str | None
    options: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Eight hexadecimal digits, of a cell sixteen."""
        return digest(canonical(asdict(self)))[: CELL_DIGITS if self.is_cell else 8]

    @property
    def is_cell(self) -> bool:
        """It is a cell of a comparison, asked once more for the time that it takes."""
        return REPETITION in self.options

    def as_cell(self, repetition: int, memory_limit: int | None) -> Question:
        """The same question as a cell."""
        limit = {} if memory_limit is None else {"memory_limit": memory_limit}
        return replace(self, options={**self.options, REPETITION: repetition, **limit})

    @property
    def untimed(self) -> Question:
        """The question without a time limit, which stops an iteration and changes no round."""
        return replace(self, options={**self.options, "time_limit": None})


def asked(options: Options, judged: float | None = None) -> dict[str, Any]:
    """The options that may change an answer.

    The tolerance is that of the certificate (`Task.judging_tolerance`) where there is one: a
    tolerance that a method does not heed changes no answer, so it asks the same question.
    """
    return {
        "tolerance": options.accuracy if judged is None else judged,
        "time_limit": options.time_limit,
        "seed": options.seed,
    }


def canonical(value: Any) -> str:
    """One text for one value: sorted keys, no spaces."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def plain(value: Any) -> Any:
    """A value as JSON has it: NumPy scalars as numbers, NaN and infinities as their names."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def is_same(one: Any, other: Any) -> bool:
    """Whether two values are the same in kind and number; lists and tuples are of one kind."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(is_same, one, other))
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        kinds = ({(type(key), key) for key in each} for each in (one, other))
        return next(kinds) == next(kinds) and all(is_same(one[key], other[key]) for key in one)
    if isinstance(one, str):
        one.encode()  # a lone surrogate raises a ValueError
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    return type(one) is type(other) and bool(one == other)


def digest(text: str | bytes) -> str:
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()
