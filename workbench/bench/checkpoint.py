"""The state of an iteration in a file, so that an interrupted run can be resumed."""

from __future__ import annotations

import time
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.executor import Checkpoint

MARK, SECONDS, STATE = "mark", "seconds", "state/"


class FileCheckpoint(Checkpoint):
    """A state as an npz file without pickles; the file appears whole or not at all.

    Processes that ask the same question with different time limits share the file; each can resume
    from the state that another has left.

    Parameters
    ----------
    file
        Path of the checkpoint.
    scratch
        Path used by this process only: the file is written there, then renamed to its place.
    mark
        Hash of question and code; a state with another hash is not used.

    Attributes
    ----------
    earlier
        Seconds that earlier runs took to reach the loaded state; 0 if none was loaded.
    """

    def __init__(self, file: Path, scratch: Path, mark: str) -> None:
        self._file, self._scratch, self._mark = file, scratch, mark
        self._started = time.perf_counter()
        self.earlier = 0.0

    def save(self, state: Mapping[str, NDArray[Any]]) -> None:
        spent = self.earlier + time.perf_counter() - self._started
        content: dict[str, Any] = {STATE + k: np.asarray(array) for k, array in state.items()}
        pickled = [name for name, array in state.items() if np.asarray(array).dtype.hasobject]
        if pickled:  # NumPy 2.0 and 2.1 have no option to refuse pickles
            raise ValueError(f"{', '.join(pickled)}: an array of objects would need a pickle")
        content |= {MARK: np.array(self._mark), SECONDS: np.array(spent)}
        self._scratch.parent.mkdir(parents=True, exist_ok=True)
        with self._scratch.open("wb") as stream:
            np.savez(stream, **content)
        self._scratch.replace(self._file)

    def load(self) -> dict[str, NDArray[Any]] | None:
        content = self._read()
        if content is None:
            return None
        self.earlier = float(content[SECONDS])
        return {k.removeprefix(STATE): v for k, v in content.items() if k.startswith(STATE)}

    @property
    def kept(self) -> bool:
        """Whether there is a stored state from which to continue."""
        return self._read() is not None

    def drop(self) -> None:
        """Delete the stored state."""
        self._file.unlink(missing_ok=True)

    def _read(self) -> dict[str, NDArray[Any]] | None:
        """The file's arrays; None if it is missing, damaged, or has another mark."""
        try:
            # NumPy would not close a file that it finds damaged.
            with self._file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
                content = dict(stored)
                return content if str(content[MARK]) == self._mark else None
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile, zlib.error):
            return None
