"""What somebody sees who watches a run at a terminal."""

import io
import re
import sys

import pytest

from workbench.executor import silent, unwatched
from workbench.terminal import SHOWN_ROUNDS, shown_live


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def seen(monkeypatch):
    """Calls a function at a terminal; returns what it writes, without its colours and motions."""
    for name, value in {"TERM": "xterm", "COLUMNS": "80", "LINES": "40"}.items():
        monkeypatch.setenv(name, value)

    def call(work):
        file = Terminal()
        monkeypatch.setattr(sys, "stderr", file)  # not before: pytest sets its own for the test
        work()
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", file.getvalue())
        return text.replace("\r", "\n").splitlines()

    return call


def test_the_last_rounds_are_an_aligned_table_beside_the_bar(seen):
    def work():
        rows = []
        with shown_live("plant") as (progress, watch):
            for number in range(1, SHOWN_ROUNDS + 4):
                rows.append({"round": number, "peak": 10.0 / number, "fit": float("nan")})
                watch(rows)
                progress("mu synthesis", number, 30)

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
    def work():
        with shown_live("plant") as (progress, _):
            progress("vectors", 2, 7)

    lines = seen(work)
    assert any("plant" in line and "vectors 2/7" in line for line in lines)
    assert not any("round" in line for line in lines)


def test_nothing_is_drawn_where_nobody_watches(monkeypatch):
    file = io.StringIO()
    monkeypatch.setattr(sys, "stderr", file)
    with shown_live("plant") as pair:
        assert pair == (silent, unwatched)
    assert file.getvalue() == ""
