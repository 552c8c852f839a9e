"""Cells that were answered before, in results folders or as light records."""

from __future__ import annotations

import json
import sqlite3
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from workbench.bench.cells.answer import Cell
from workbench.bench.cells.record import Record
from workbench.bench.question import canonical
from workbench.bench.run import earlier_run, need_same
from workbench.bench.store import CELLS, Store
from workbench.errors import ResultError

LIGHT = "light.sqlite"
"""Name of the file with the light records, in the folder of the cells."""


def in_folder(store: Store, cell: Cell) -> Record | None:
    """The record in a cell's results folder, be it an answer or a failure, if it may be reused.

    Raises
    ------
    ResultError
        The folder holds another cell, whose key is the same.
    """
    question = cell.question
    for place in store.places(question.problem, question.key):
        run = earlier_run(place, question)
        if run is not None and run.info["code"] == cell.code:
            return Record.stored(run)
    return None


class Journal(AbstractContextManager["Journal"]):
    """Light records of cells below a results root, one row for each; written when a cell ends."""

    def __init__(self, root: Path) -> None:
        self.file = root / CELLS / LIGHT
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            self._rows = sqlite3.connect(self.file, timeout=60.0, isolation_level=None)
            # A killed process does no harm, and no cell has to wait for the disk.
            self._rows.execute("pragma journal_mode = wal")
            self._rows.execute("pragma synchronous = normal")
            self._rows.execute(
                "create table if not exists cells "
                "(key text primary key, code text, question text, record text) without rowid"
            )
        except (OSError, sqlite3.Error) as error:
            raise ResultError(f"light records cannot be kept in {self.file}: {error}") from None

    def __exit__(self, *error: Any) -> None:
        # another process is writing: the last one does this
        with suppress(sqlite3.OperationalError):
            # merge into one file, which can be read without writing
            self._rows.execute("pragma journal_mode = delete")
        self._rows.close()

    def find(self, cell: Cell) -> Record | None:
        """The record of a cell, if it may be reused. Raises as `in_folder`."""
        try:
            row = self._rows.execute(
                "select code, question, record from cells where key = ?", (cell.question.key,)
            ).fetchone()
            if row is None:
                return None
            code, question, record = row[0], json.loads(row[1]), json.loads(row[2])
        except (sqlite3.Error, ValueError) as error:
            raise ResultError(f"{self.file} cannot be read: {error}") from None
        need_same(cell.question, question, f"{self.file}, {cell.question.key}")
        return Record.from_json(record, str(self.file)) if code == cell.code else None

    def keep(self, cell: Cell, record: Record) -> None:
        """Store how a cell ended, replacing an earlier record."""
        question = cell.question
        row = (question.key, cell.code, canonical(asdict(question)), canonical(record.to_json()))
        try:
            self._rows.execute("insert or replace into cells values (?, ?, ?, ?)", row)
        except sqlite3.Error as error:
            raise ResultError(f"{self.file} cannot be written: {error}") from None


def light_records(root: Path) -> dict[str, tuple[str, Record]]:
    """Code and light record of every cell below a results root, by key; opened read-only.

    Raises
    ------
    ResultError
        The records cannot be read.
    """
    file = root / CELLS / LIGHT
    if not file.exists():
        return {}
    try:
        rows = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)
        try:
            found = rows.execute("select key, code, record from cells").fetchall()
        finally:
            rows.close()
        return {
            key: (str(code), Record.from_json(json.loads(text), str(file)))
            for key, code, text in found
        }
    except (sqlite3.Error, ValueError) as error:
        raise ResultError(f"{file} cannot be read: {error}") from None
