"""Results folders that appear whole or not at all.

A folder is written below ``.partial`` and then renamed to its place; an older folder is renamed
away first. One lock per question makes processes that ask the same question wait for each other;
the operating system releases it when its holder dies. The remains of a dead holder are cleaned up
under its lock.

    <root>/<problem>/<key>           a finished result
    <root>/cells/<problem>/<key>     a finished cell of comparisons
    <root>/.partial/<slug>.lock      the lock of one question
    <root>/.partial/<slug>/new       a folder being written
    <root>/.partial/<slug>/old       an earlier result while it is being replaced
    <root>/.partial/<slug>/failure   an earlier failure, to be dropped
    <root>/.partial/<slug>.npz       where an iteration was stopped
    <root>/.partial/beside           new answers to needs, until the run that needs them has ended
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from workbench.bench.question import CELL_DIGITS
from workbench.bench.trust.untrusted import own_file, read_text
from workbench.errors import ResultError

CHECKSUMS = "SHA256SUMS"
FAILED = ".failed"
PARTIAL = ".partial"
BESIDE = "beside"
REFERENCE = "reference"
"""Name of the committed reference results: they are listed and verified only if asked for by path,
and never written.
"""
CELLS = "cells"
"""Name of the folder of comparisons' cells; there may be very many, so they are listed only if
asked for by path.
"""


class Store:
    """The results folders below one root."""

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root)

    def folder(self, problem: str, key: str) -> Path:
        """The results folder of a question; a cell has a key of sixteen digits."""
        root = self.root / CELLS if len(key) == CELL_DIGITS else self.root
        return root / problem / key

    def places(self, problem: str, key: str) -> tuple[Path, Path]:
        """The folders for a question's answer, and for its failure."""
        folder = self.folder(problem, key)
        return folder, folder.with_name(folder.name + FAILED)

    @property
    def beside(self) -> Store:
        """The store of answers that will replace earlier ones once the run that needs them ends."""
        return Store(self.root / PARTIAL / BESIDE)

    @property
    def searched(self) -> tuple[Store, ...]:
        """The stores that may hold the needs of a run that lies in this one, the nearest first."""
        if self.root.parts[-2:] == (PARTIAL, BESIDE):
            return self, Store(self.root.parents[1])
        return (self,)

    def checkpoint(self, problem: str, key: str) -> Path:
        """The file in which an iteration stores its state between rounds."""
        return _partial(self.root, problem, key, ".npz")

    def folders(self) -> list[Path]:
        """Every finished result without failures, sorted by problem and key."""
        self.mend()
        found = []
        for place, below, names in os.walk(self.root):
            if CHECKSUMS in names:
                found.append(Path(place))
                below.clear()
            elif Path(place) == self.root:
                below[:] = [name for name in below if name not in (PARTIAL, REFERENCE, CELLS)]
        return sorted(folder for folder in found if folder.suffix != FAILED)

    @contextmanager
    def writing(self, problem: str, key: str) -> Iterator[Writer]:
        """Hold the lock of a question; a folder that the writer publishes appears whole."""
        writer = Writer(self, problem, key)
        try:
            writer.space.parent.mkdir(parents=True, exist_ok=True)
            with _locked(writer.lock):
                try:
                    writer.mend()
                    yield writer
                finally:
                    writer.mend()
        # a full disk, a folder without write permission, or a file in its place
        except OSError as error:
            reason = f"{error.strerror}: {error.filename}" if error.filename else str(error)
            raise ResultError(f"cannot write results below {self.root}: {reason}") from None

    def mend(self) -> None:
        """Clean up after killed processes; running ones are not disturbed."""
        from filelock import Timeout

        space = self.root / PARTIAL
        left = {
            file.name.removesuffix(".lock") for file in (*space.glob("*.lock"), *space.glob("*/"))
        }
        for name in sorted(left):
            problem, dash, key = name.rpartition("-")
            problem = unquote(problem)
            # the name would lead outside
            if not dash or {"", ".", ".."} & {key, *problem.split("/")}:
                continue
            writer = Writer(self, problem, key)
            try:
                with _locked(writer.lock, blocking=False):
                    writer.mend()
            # its process is running, or the folder belongs to somebody else
            except (Timeout, OSError):
                continue


@contextmanager
def _locked(file: Path, *, blocking: bool = True) -> Iterator[None]:
    """Hold a lock, and delete its file afterwards.

    A waiting process may get the lock of a file that has been deleted, while another process holds
    the lock of a new file. So after getting a lock it checks that the file is still in place, and
    otherwise tries again.

    Raises
    ------
    Another process holds the lock, and ``blocking`` is false.
        Another process holds it, and ``blocking`` is false.
    """
    from filelock import FileLock

    while True:
        lock = FileLock(file, blocking=blocking)
        lock.acquire()
        if _same_file(file, lock):
            break
        lock.release()
    try:
        yield
    finally:
        if os.name != "nt":  # Windows does not delete an open file
            file.unlink(missing_ok=True)
        lock.release()


def _same_file(file: Path, lock: Any) -> bool:
    """Whether a lock belongs to the file that is in place now."""
    if os.name == "nt":
        return True
    try:
        held = os.fstat(lock._context.lock_file_fd)  # filelock has no public name for it
        return os.path.samestat(held, file.stat())
    except FileNotFoundError:
        return False


class Writer:
    """The only process that may write the result of a question at this time."""

    def __init__(self, store: Store, problem: str, key: str) -> None:
        self.final, self.failure = store.places(problem, key)
        self.space = _partial(store.root, problem, key)
        self.lock = _partial(store.root, problem, key, ".lock")
        self.new = self.space / "new"
        self.old = self.space / "old"

    def start(self) -> Path:
        """Make an empty folder for the result."""
        self.new.mkdir(parents=True)
        return self.new

    def publish(self, *, failed: bool = False) -> Path:
        """Seal the new folder and move it to its place; a failure has a place of its own."""
        seal(self.new)
        return self._put_in_place(failed)

    def take(self, folder: Path) -> Path:
        """Move a finished answer or failure here from another folder."""
        self.space.mkdir(parents=True)
        folder.rename(self.new)
        return self._put_in_place(folder.name.endswith(FAILED))

    def _put_in_place(self, failed: bool) -> Path:
        final = self.failure if failed else self.final
        final.parent.mkdir(parents=True, exist_ok=True)
        if self.failure.exists():  # an earlier failure, now repeated or answered
            self.failure.rename(self.space / "failure")
        if final.exists():
            final.rename(self.old)
        self.new.rename(final)
        return final

    def mend(self) -> None:
        """Delete a half-written folder.

        Restore an earlier result whose replacement was interrupted.
        """
        if self.old.exists() and not self.final.exists():
            self.old.rename(self.final)
        shutil.rmtree(self.space, ignore_errors=True)


def _partial(root: Path, problem: str, key: str, suffix: str = "") -> Path:
    return root / PARTIAL / f"{quote(problem, safe='')}-{key}{suffix}"


def seal(folder: Path) -> None:
    """Write the checksums of every file of a folder; this comes last."""
    lines = [f"{file_hash(folder / name)}  {name}\n" for name in files(folder)]
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def files(folder: Path) -> list[str]:
    """Names of the files of a results folder without its checksums; links count as files."""
    found = (p for p in folder.rglob("*") if p.is_symlink() or not p.is_dir())
    names = (p.relative_to(folder).as_posix() for p in found)
    return sorted(name for name in names if name != CHECKSUMS)


def file_hash(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def damage(folder: Path) -> list[str]:
    """One sentence for each file that does not match the folder's checksums."""
    sums = folder / CHECKSUMS
    if not sums.is_file():
        return [f"{CHECKSUMS} is missing: the folder is not a finished result"]
    try:
        text = read_text(sums)
    except ResultError as error:
        return [str(error)]
    expected = {}
    for number, line in enumerate(text.splitlines(), start=1):
        digest, gap, name = line.partition("  ")
        if not gap or len(digest) != 64:
            return [f"{CHECKSUMS} line {number} is not a checksum: {line[:40]!r}"]
        expected[name] = digest
    present = set(files(folder))
    found = [f"{name} is missing" for name in sorted(expected.keys() - present)]
    found += [f"{name} is not in {CHECKSUMS}" for name in sorted(present - expected.keys())]
    for name in sorted(expected.keys() & present):
        try:
            actual = file_hash(own_file(folder / name))
        except (OSError, ResultError) as error:
            found.append(f"{name}: {error}")
            continue
        if actual != expected[name]:
            size = (folder / name).stat().st_size
            found.append(
                f"{name} was changed: SHA-256 {actual}, not {expected[name]} ({size} bytes now)"
            )
    return found
