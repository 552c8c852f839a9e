"""Results folders that appear whole or not at all.

A folder is written beside its place, below ``.partial``, and renamed in; an older one is renamed
aside first. One lock per question serialises processes that ask the same; the operating system
frees it when its holder dies. Whatever a dead holder left is mended under its lock.

    <root>/<problem>/<key>           a finished result
    <root>/cells/<problem>/<key>     a finished cell of comparisons
    <root>/.partial/<slug>.lock      the lock of one question
    <root>/.partial/<slug>/new       a folder being written
    <root>/.partial/<slug>/old       an earlier result while it is being replaced
    <root>/.partial/<slug>/failure   an earlier failure, to be dropped
    <root>/.partial/<slug>.npz       where an iteration was stopped
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
REFERENCE = "reference"
"""The committed reference results: listed and verified when asked for by path, never written."""
CELLS = "cells"
"""Where the cells of comparisons are: there may be very many, listed when asked for by path."""


class Store:
    """The results folders below one root."""

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root)

    def folder(self, problem: str, key: str) -> Path:
        """The results folder of a question; a key of sixteen digits is a cell's."""
        root = self.root / CELLS if len(key) == CELL_DIGITS else self.root
        return root / problem / key

    def places(self, problem: str, key: str) -> tuple[Path, Path]:
        """The folders of a question's answer, and of its failure."""
        folder = self.folder(problem, key)
        return folder, folder.with_name(folder.name + FAILED)

    def checkpoint(self, problem: str, key: str) -> Path:
        """The file in which an iteration keeps its state between rounds."""
        return _partial(self.root, problem, key, ".npz")

    def folders(self) -> list[Path]:
        """Every finished result, failures left out, sorted by problem and key."""
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
        """Hold the lock of a question; what the writer publishes appears whole."""
        writer = Writer(self, problem, key)
        try:
            writer.space.parent.mkdir(parents=True, exist_ok=True)
            with _locked(writer.lock):
                try:
                    writer.mend()
                    yield writer
                finally:
                    writer.mend()
        except OSError as error:  # a full disk, a folder that may not be written, a file in its way
            reason = f"{error.strerror}: {error.filename}" if error.filename else str(error)
            raise ResultError(f"cannot write results below {self.root}: {reason}") from None

    def mend(self) -> None:
        """Undo what killed processes left; running ones are not disturbed."""
        from filelock import Timeout

        space = self.root / PARTIAL
        left = {
            file.name.removesuffix(".lock") for file in (*space.glob("*.lock"), *space.glob("*/"))
        }
        for name in sorted(left):
            problem, dash, key = name.rpartition("-")
            problem = unquote(problem)
            if not dash or {"", ".", ".."} & {key, *problem.split("/")}:  # it would lead elsewhere
                continue
            writer = Writer(self, problem, key)
            try:
                with _locked(writer.lock, blocking=False):
                    writer.mend()
            except (Timeout, OSError):  # its process is alive, or the folder is not ours
                continue


@contextmanager
def _locked(file: Path, *, blocking: bool = True) -> Iterator[None]:
    """Hold a lock, and remove its file with it.

    Who waited for it may get the lock of a file that is gone by then, while another one holds that
    of a new file: so whoever gets a lock sees that its file is still in place, and else asks again.

    Raises
    ------
    Timeout
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
        if os.name != "nt":  # Windows removes no file that is open
            file.unlink(missing_ok=True)
        lock.release()


def _same_file(file: Path, lock: Any) -> bool:
    """Whether a lock is on the file that is in place now."""
    if os.name == "nt":
        return True
    try:
        held = os.fstat(lock._context.lock_file_fd)  # filelock has no public name for it
        return os.path.samestat(held, file.stat())
    except FileNotFoundError:
        return False


class Writer:
    """The one process that may write the result of a question."""

    def __init__(self, store: Store, problem: str, key: str) -> None:
        self.final, self.failure = store.places(problem, key)
        self.space = _partial(store.root, problem, key)
        self.lock = _partial(store.root, problem, key, ".lock")
        self.new = self.space / "new"
        self.old = self.space / "old"

    def start(self) -> Path:
        """An empty folder to write the result in."""
        self.new.mkdir(parents=True)
        return self.new

    def publish(self, *, failed: bool = False) -> Path:
        """Seal the new folder and move it to its place; a failure goes beside it."""
        seal(self.new)
        final = self.failure if failed else self.final
        final.parent.mkdir(parents=True, exist_ok=True)
        if self.failure.exists():  # repeated now, or answered
            self.failure.rename(self.space / "failure")
        if final.exists():
            final.rename(self.old)
        self.new.rename(final)
        return final

    def mend(self) -> None:
        """Drop a half-written folder; put an earlier result back where its swap was cut short."""
        if self.old.exists() and not self.final.exists():
            self.old.rename(self.final)
        shutil.rmtree(self.space, ignore_errors=True)


def _partial(root: Path, problem: str, key: str, suffix: str = "") -> Path:
    return root / PARTIAL / f"{quote(problem, safe='')}-{key}{suffix}"


def seal(folder: Path) -> None:
    """Write the checksums of every file of a folder, last."""
    lines = [f"{file_hash(folder / name)}  {name}\n" for name in files(folder)]
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def files(folder: Path) -> list[str]:
    """Names of the files of a results folder, its checksums left out; links are files too."""
    found = (p for p in folder.rglob("*") if p.is_symlink() or not p.is_dir())
    names = (p.relative_to(folder).as_posix() for p in found)
    return sorted(name for name in names if name != CHECKSUMS)


def file_hash(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def damage(folder: Path) -> list[str]:
    """A sentence for each file that differs from the folder's checksums."""
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
