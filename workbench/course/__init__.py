"""The course and the examples: where their files are, and functions that copy them for a reader.

Takes: the name of a folder.
Gives: ten notebooks, and folders of scripts that go from records to C.
Rests on: tests that run them (`workbench.course.execution`); no theorem is needed.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from workbench.errors import InputError

_HERE = Path(__file__).parent


def notebook_files() -> list[Path]:
    """The notebooks of the course in the order in which they are read.

    In a checkout they stand in ``notebooks``, in a wheel beside this module.
    """
    return sorted(_folder("notebooks").glob("[0-9][0-9]_*.ipynb"))


def example_files() -> list[Path]:
    """The files of the examples, each in the folder of its example; placed as the notebooks are."""
    return sorted(file for end in ("md", "py") for file in _folder("examples").glob(f"*/*.{end}"))


def _folder(name: str) -> Path:
    packed = _HERE / name
    return packed if packed.is_dir() else _HERE.parents[1] / name


def copy_notebooks(folder: str | Path) -> list[Path]:
    """Copy the notebooks of the course into a folder and return the copies.

    A missing folder is made.

    Raises
    ------
    InputError
        The folder holds one of them already; a reader's own work is never overwritten.
    """
    return _copy_files({file: file.name for file in notebook_files()}, Path(folder))


def copy_examples(folder: str | Path) -> list[Path]:
    """Copy the examples into a folder, each into a folder of its own, and return the copies.

    Raises as `copy_notebooks`.
    """
    names = {file: f"{file.parent.name}/{file.name}" for file in example_files()}
    return _copy_files(names, Path(folder))


def _copy_files(names: Mapping[Path, str], place: Path) -> list[Path]:
    """Copy files below a place under the given names, and return the copies."""
    copies = [place / name for name in names.values()]
    there = [name for name in names.values() if (place / name).exists()]
    if there:
        raise InputError(f"{place} has {', '.join(there)} already: name another folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
        for file, copy in zip(names, copies, strict=True):
            copy.parent.mkdir(exist_ok=True)
            shutil.copyfile(file, copy)
    except OSError as error:
        raise InputError(f"cannot write {error.filename}: {error.strerror}") from None
    return copies
