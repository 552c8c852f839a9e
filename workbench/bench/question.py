"""The question a run answers, and its key.

The key is a hash of the question, never of versions: the same question finds the same folder
everywhere. The code that answered is hashed apart, to tell whether a stored answer may be reused.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import workbench
from workbench.solvers import Options, versions

Keys = Mapping[str, str | list[str]]


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
        """Eight hexadecimal digits."""
        return digest(canonical(asdict(self)))[:8]

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


def digest(text: str | bytes) -> str:
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()


def code_hash(plants: Iterable[str], upstream: Iterable[str] = ()) -> str:
    """Hash of what may change an answer besides the question.

    The workbench's sources, those of the ``plants`` as they were imported, the solvers' versions,
    and the code hashes of the results that the problem was fed with.
    """
    return digest("".join([_own(), *sorted(plants), *upstream]) + canonical(versions()))[:16]


@cache
def _own() -> str:
    """The workbench's sources as they are at the first call, near enough to their import."""
    return sources(Path(workbench.__file__).parent)


def sources(folder: Path) -> str:
    """Names and hashes of the sources of a folder."""
    files = sorted(folder.rglob("*.py"), key=lambda file: file.relative_to(folder).parts)
    plants = folder / "plants"  # a problem's own folder is hashed by itself
    lines = (
        f"{file.relative_to(folder).as_posix()} {digest(file.read_bytes())}\n"
        for file in files
        if plants not in file.parents
    )
    return "".join(lines)
