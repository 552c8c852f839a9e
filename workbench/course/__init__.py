"""The course: ten notebooks, where they are and how a reader gets them.

`workbench.course.execution` runs them and makes their outputs anew.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from workbench.errors import InputError

_HERE = Path(__file__).parent


def notebook_files() -> list[Path]:
    """The notebooks of the course in the order in which they are read.

    In a checkout they stand in ``notebooks``, in a wheel beside this module.
    """
    packed = _HERE / "notebooks"
    folder = packed if packed.is_dir() else _HERE.parents[1] / "notebooks"
    return sorted(folder.glob("[0-9][0-9]_*.ipynb"))


def copy_notebooks(folder: str | Path) -> list[Path]:
    """Copy the notebooks of the course into a folder, which is made if it is missing; the copies.

    Raises
    ------
    InputError
        The folder holds one of them already: a reader's own work is never written over.
    """
    place = Path(folder)
    copies = [place / file.name for file in notebook_files()]
    there = [copy.name for copy in copies if copy.exists()]
    if there:
        raise InputError(f"{place} has {', '.join(there)} already: name another folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
        for file, copy in zip(notebook_files(), copies, strict=True):
            shutil.copyfile(file, copy)
    except OSError as error:
        raise InputError(f"cannot write {error.filename}: {error.strerror}") from None
    return copies
