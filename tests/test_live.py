"""What somebody sees who waits, at a terminal and in a notebook."""

import contextlib
import io
import re
import sys
import time

import nbformat
import pytest
from nbclient import NotebookClient

import workbench.executor.live as live
from workbench._core import compiled
from workbench.executor import no_progress, no_watch
from workbench.executor.live import SHOWN_ROUNDS, shown_live


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def seen(monkeypatch):
    """Calls a function at a terminal; returns what it writes, without its colours and motions."""
    for name, value in {"TERM": "xterm", "COLUMNS": "100", "LINES": "40"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(live, "PATIENCE", 0.0)
    monkeypatch.setattr(live, "INTERVAL", 0.01)

    def call(work):
        file = Terminal()
        monkeypatch.setattr(sys, "stderr", file)  # not before: pytest sets its own for the test
        work(file)
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", file.getvalue())
        return text.replace("\r", "\n").splitlines()

    return call


def wait_for(file, words):
    """Wait until words are written; a second is enough for any thread to get its turn."""
    until = time.monotonic() + 5
    while words not in file.getvalue():
        assert time.monotonic() < until, f"{words!r} was not shown"
        time.sleep(0.01)


def test_the_last_rounds_are_an_aligned_table_beside_the_bar(seen):
    def work(file):
        rows = []
        with shown_live("plant") as (progress, watch):
            for number in range(1, SHOWN_ROUNDS + 4):
                rows.append({"round": number, "peak": 10.0 / number, "fit": float("nan")})
            watch(rows)
            progress("mu synthesis", number, 30)
            wait_for(file, "mu synthesis 18/30")

    lines = seen(work)
    last = max(i for i, line in enumerate(lines) if "peak" in line)
    table = [line.rstrip() for line in lines[last : last + SHOWN_ROUNDS + 2]]
    assert table[0].split() == ["round", "peak", "fit"]
    found = [line.split() for line in table[1 : SHOWN_ROUNDS + 1]]
    assert found == [[str(n), f"{10 / n:.4g}", "-"] for n in range(4, SHOWN_ROUNDS + 4)]
    assert (
        len({len(line) for line in table[: SHOWN_ROUNDS + 1]}) == 1
    )  # numbers end below one another
    assert "plant" in table[-1] and "mu synthesis 18/30" in table[-1]


def test_work_without_rounds_has_a_bar_alone(seen):
    def work(file):
        with shown_live("plant") as (progress, _):
            progress("vectors", 2, 7)
            wait_for(file, "vectors 2/7")

    lines = seen(work)
    assert any("plant" in line and "vectors 2/7" in line for line in lines)
    assert not any("round" in line for line in lines)


def test_nothing_is_drawn_where_nobody_watches(monkeypatch):
    file = io.StringIO()
    monkeypatch.setattr(sys, "stderr", file)
    with shown_live("plant") as pair:
        assert pair == (no_progress, no_watch)
    assert file.getvalue() == ""


def test_nothing_is_drawn_of_short_work(seen, monkeypatch):
    monkeypatch.setattr(live, "PATIENCE", 60.0)

    def work(file):
        with shown_live("plant") as (progress, _):
            progress("vectors", 2, 7)

    assert seen(work) == []


def test_work_within_work_is_not_shown_apart(seen):
    def work(file):
        with shown_live("outer") as (progress, _), shown_live("inner") as inner:
            assert inner == (no_progress, no_watch)
            progress("vectors", 2, 7)
            wait_for(file, "vectors 2/7")

    assert not any("inner" in line for line in seen(work))


def test_what_fails_takes_its_bar_away(seen):
    def work(file):
        with contextlib.suppress(RuntimeError), shown_live("plant") as (progress, _):
            progress("vectors", 2, 7)
            wait_for(file, "vectors 2/7")
            raise RuntimeError
        with shown_live("next") as (progress, _):
            progress("vectors", 3, 7)
            wait_for(file, "vectors 3/7")

    assert any("next" in line for line in seen(work))


def test_compiling_is_said_beside_what_waits_for_it_and_alone(seen, monkeypatch):
    """The same as a compilation does, whose time depends on what is on the disk."""

    def work(file):
        for watcher in compiled._watchers:
            with watcher("mu.upper.fast.descend", 12, 64):
                wait_for(file, "descend 12/64")
            with shown_live("plant") as (progress, _), watcher("mu.upper.fast.centre", 13, 64):
                progress("vectors", 2, 7)
                wait_for(file, "centre 13/64")

    lines = seen(work)
    assert any("compiling" in line and "fast.descend 12/64" in line for line in lines)


def test_a_long_compilation_is_told_once_where_nothing_can_be_drawn(monkeypatch, capsys):
    monkeypatch.setattr(live, "SILENCE", 0.01)
    monkeypatch.setattr(live, "_outlet", lambda: None)
    live._announce.cache_clear()
    for _ in range(2):
        with live._while_compiling("mu.upper.fast.descend", 12, 64):
            time.sleep(0.2)
    assert capsys.readouterr().err.count("workbench: compiling loops") == 1
    monkeypatch.setattr(live, "SILENCE", 60.0)
    live._announce.cache_clear()
    with live._while_compiling("mu.upper.fast.descend", 12, 64):
        pass
    assert capsys.readouterr().err == ""


NOTEBOOK = """
import sys, time
import workbench as wb, xarray as xr
from workbench.study import Study

class Slow(Study):
    def compute(self, context):
        for _ in context.track(range(15), "vectors"):
            time.sleep(0.1)
        return xr.Dataset({"total": 1.0})
    def checks(self, answer, tolerance): return [wb.Check("done", "nothing", 0.0, 0.0)]
    def metrics(self, answer): return {}

wb.solve(Slow()).outcome
"""


def test_a_notebook_shows_progress_and_takes_it_away():
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(NOTEBOOK)])
    shown = []

    class Client(NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"] in ("display_data", "update_display_data"):
                shown.append(message["content"]["data"]["text/plain"])
            return super().process_message(message, cell, index)

    Client(notebook, timeout=120, kernel_name="python3").execute()
    assert any("Slow" in text and "/15" in text for text in shown), shown
    assert shown[-1] == ""
    kept = [out.data["text/plain"] for out in notebook.cells[0].outputs if "data" in out]
    assert kept == ["", "<Outcome.SOLVED: 'solved'>"]
