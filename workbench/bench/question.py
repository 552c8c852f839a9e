"""The question a run answers, and its key.

The key is a hash of the question, without versions, so the same question has the same folder
everywhere. The code that answered has a hash of its own (`workbench.bench.code`), which decides
whether a stored answer may be reused.
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
"""Length of a cell's key: among a hundred thousand keys of eight digits some would coincide."""
REPETITION = "repetition"
"""The option that distinguishes a cell's question."""


@dataclass(frozen=True)
class Question:
    """Everything except the code that can change an answer."""

    problem: str
    parameters: Mapping[str, Any]
    data: Mapping[str, str]
    needs: Keys
    method: str | None
    options: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Eight hexadecimal digits; for a cell sixteen."""
        return digest(canonical(asdict(self)))[: CELL_DIGITS if self.is_cell else 8]

    @property
    def is_cell(self) -> bool:
        """Whether it is a cell of a comparison, asked again to measure the time."""
        return REPETITION in self.options

    def as_cell(self, repetition: int, memory_limit: int | None) -> Question:
        """The same question, as that of a cell."""
        limit = {} if memory_limit is None else {"memory_limit": memory_limit}
        return replace(self, options={**self.options, REPETITION: repetition, **limit})

    @property
    def untimed(self) -> Question:
        """The question without its time limit, which ends an iteration but changes no round."""
        return replace(self, options={**self.options, "time_limit": None})


def asked(options: Options, judged: float | None = None) -> dict[str, Any]:
    """The options that can change an answer.

    The tolerance is that of the certificate (`Task.judging_tolerance`), if there is one: a
    tolerance that the method ignores changes no answer, so the question is the same.
    """
    return {
        "tolerance": options.accuracy if judged is None else judged,
        "time_limit": options.time_limit,
        "seed": options.seed,
    }


def canonical(value: Any) -> str:
    """One text for equal values: keys sorted, no spaces."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def plain(value: Any) -> Any:
    """A value in the form of JSON: NumPy scalars as numbers, NaN and infinities by name."""
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
    """Whether two values are equal in type and number; lists and tuples count as one type."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(is_same, one, other))
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        kinds = ({(type(key), key) for key in each} for each in (one, other))
        return next(kinds) == next(kinds) and all(is_same(one[key], other[key]) for key in one)
    if isinstance(one, str):
        one.encode()  # an unpaired surrogate raises a ValueError
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    return type(one) is type(other) and bool(one == other)


def digest(text: str | bytes) -> str:
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()
