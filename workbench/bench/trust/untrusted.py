"""Safe reading of a results folder made by somebody else: only its own files, within bounds.

A folder can be made to harm whoever opens it: by a link or a path that leads out of it, by two
kilobytes that unpack to gigabytes, or by brackets nested a hundred thousand deep. All of these are
refused by name before they are read.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from workbench.errors import ResultError

LARGEST_TEXT = 64 * 2**20
"""Largest size [bytes] of a JSON file or log that is read."""
DEEPEST = 50
"""Largest depth of nested brackets in JSON that is read."""
LARGEST_ARRAYS, LARGEST_GROWTH = 256 * 2**20, 100
"""Total size [bytes] of a file's arrays that is always read, and the largest ratio of a larger
total to the size of the file.
"""
MOST_ARRAYS = 10_000
"""Largest number of arrays in a file that is read."""

_PROBLEM = re.compile(r"\w(?:[\w.-]*[\w-])?(?:/\w(?:[\w.-]*[\w-])?)*")
_KEY = re.compile(r"[0-9a-f]{8}(?:[0-9a-f]{8})?")
_FILE = re.compile(r"[\w][\w .+-]*")


def problem_name(name: Any) -> str:
    """A stored name of a problem, checked because it becomes a path."""
    if isinstance(name, str) and _PROBLEM.fullmatch(name):
        return name
    raise ResultError(f"{_short(name)} is no name of a problem: words with '/' between are needed")


def question_key(key: Any) -> str:
    """A stored key, checked because it becomes the name of a folder."""
    if isinstance(key, str) and _KEY.fullmatch(key):
        return key
    raise ResultError(f"{_short(key)} is no key: eight or sixteen hexadecimal digits are needed")


def file_stem(name: str) -> str:
    """The stored name of a figure or table, checked because it becomes a file name."""
    if _FILE.fullmatch(name):
        return name
    raise ResultError(f"{_short(name)} cannot be the name of a file")


def possible_path(path: str | Path) -> Path:
    """A path as a user gives it. Raises ResultError if it cannot be a path, such as a number."""
    if not isinstance(path, str | os.PathLike):
        raise ResultError(f"{_short(repr(path))} cannot be a path: it is no text")
    try:
        os.lstat(path)
    except ValueError as error:  # a NUL byte, or half of a character
        raise ResultError(f"{_short(str(path))} cannot be a path: {error}") from None
    except OSError:  # opening it will give a better message
        pass
    return Path(path)


def own_file(file: Path) -> Path:
    """A file that lies in the folder itself.

    Raises
    ------
    ResultError
        It is missing, a link, or not a regular file.
    """
    try:
        if file.is_symlink():
            raise ResultError(f"{file.name} in {file.parent} is a link: links are not followed")
        if file.is_file():
            return file
        what = "no file" if file.exists() else "missing"
    except (OSError, ValueError) as error:  # not a possible name of a file
        raise ResultError(f"{_short(str(file))} cannot be read: {error}") from None
    raise ResultError(f"{file.name} is {what} in {file.parent}")


def read_text(file: Path) -> str:
    """The text of a file. Raises ResultError if it cannot be read or is too large."""
    try:
        size = own_file(file).stat().st_size
        if size > LARGEST_TEXT:
            raise ResultError(f"{file.name} has {size} bytes; read are at most {LARGEST_TEXT}")
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise ResultError(f"{file.name} in {file.parent} cannot be read: {error}") from None


def read_json(file: Path) -> Any:
    """The content of a JSON file of the folder.

    Raises ResultError as `read_text`, and if it is not JSON or is nested too deeply.
    """
    text = read_text(file)
    if _depth(text) > DEEPEST:
        raise ResultError(f"{file.name} is nested more than {DEEPEST} deep, and not read")
    try:
        return json.loads(text)
    except ValueError as error:  # also raised for integers with more digits than Python converts
        raise ResultError(f"{file.name} is no JSON: {error}") from None


_MARKS = re.compile(r'\\.|["\[\]{}]', re.DOTALL)


def _depth(text: str) -> int:
    """Largest depth of brackets outside strings; counting stops beyond DEEPEST."""
    depth = deepest = 0
    quoted = False
    for mark in _MARKS.finditer(text):
        if mark.group() == '"':
            quoted = not quoted
        elif not quoted and len(mark.group()) == 1:
            depth += 1 if mark.group() in "[{" else -1
            deepest = max(deepest, depth)
            if deepest > DEEPEST:
                break
    return deepest


def need_bounded_arrays(file: Path) -> None:
    """Refuse an HDF5 file that leads to other files, or would unpack to far more than its size.

    Raises
    ------
    ResultError
        It is missing, a link, or not HDF5; it contains links, data in other files, too many arrays,
        or arrays too large for its size.
    """
    import h5py

    size, total = own_file(file).stat().st_size, 0
    try:
        with h5py.File(file, "r") as stored:
            for number, (name, dataset) in enumerate(_datasets(stored, file), start=1):
                if dataset.external or dataset.is_virtual:
                    raise ResultError(f"{file.name}: {name} keeps its values in other files")
                if number > MOST_ARRAYS:
                    raise ResultError(f"{file.name} has more than {MOST_ARRAYS} arrays")
                total += int(dataset.size or 0) * max(int(dataset.dtype.itemsize), 1)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise ResultError(f"{file.name} cannot be read: {error}") from None
    if total > max(LARGEST_ARRAYS, LARGEST_GROWTH * size):
        raise ResultError(
            f"{file.name} has {size} bytes and would unpack to {total}; read are at most "
            f"{LARGEST_ARRAYS}, or {LARGEST_GROWTH} times its size"
        )


def _datasets(stored: Any, file: Path) -> Iterator[tuple[str, Any]]:
    """The datasets of an HDF5 file; this workbench writes them all in the root group."""
    import h5py

    for name in stored:
        if not isinstance(stored.get(name, getlink=True), h5py.HardLink):
            raise ResultError(f"{file.name}: {name} is a link: links are not followed")
        one = stored[name]
        if not isinstance(one, h5py.Dataset):
            raise ResultError(f"{file.name}: {name} is no array")
        yield name, one


def _short(value: Any) -> str:
    """A stored value for a message; long or unprintable text is shortened."""
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
