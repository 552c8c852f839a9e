"""Live display of the progress, at a terminal or in a notebook.

Nothing is shown for work that ends within `PATIENCE`, and the display is removed when the work
ends. If nothing can be drawn, as in a log, one line reports a compilation that takes long.
"""

from __future__ import annotations

import io
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

from workbench._core.compiled import watched_by
from workbench.executor.progress import Progress, Row, Watch, no_progress, no_watch, row_entry
from workbench.executor.worker import in_worker

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

SHOWN_ROUNDS = 15
"""Most rounds of an iteration in its live table; the last ones are shown."""
PATIENCE = 0.4
"""Seconds before anything is shown."""
SILENCE = 5.0
"""Seconds that a compilation may take before a line reports it, if nothing can be drawn."""
INTERVAL = 0.2
"""Seconds between two updates of the display."""
WIDTH = 100
"""Columns of the display in a notebook."""

Said = tuple[str, int, int]
"""A description of the work, how much of it is done, and how much there is."""
Draw = Callable[["RenderableType | None"], None]
"""Shows the state of the work in place of the previous one; None: removes it."""


class _Display:
    """The state of a piece of work, drawn by a separate thread while the work goes on."""

    def __init__(self, title: str, draw: Draw, patience: float) -> None:
        self._title, self._draw = title, draw
        self._said: Said | None = None
        self._rows: Sequence[Row] = ()
        self.compiling: Said | None = None
        self._started = time.monotonic()
        self._ended = threading.Event()
        self._drawn = False
        self._thread = threading.Thread(target=self._keep_drawing, args=[patience], daemon=True)
        self._thread.start()

    def show(self, description: str, done: int, total: int) -> None:
        self._said = (description, done, total)

    def watch(self, rows: Sequence[Row]) -> None:
        self._rows = rows

    def end(self) -> None:
        self._ended.set()
        self._thread.join()
        if self._drawn:
            self._draw(None)

    def _keep_drawing(self, wait: float) -> None:
        while not self._ended.wait(wait):
            wait, self._drawn = INTERVAL, True
            self._draw(self._picture())

    def _picture(self) -> RenderableType:
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        bars = Table.grid(padding=(0, 1))
        titled = ((self._title, self._said), ("compiling, once", self.compiling))
        for title, said in titled:
            if said is not None:
                description, done, total = said
                bar = ProgressBar(total=total or 1, completed=done, width=30)
                bars.add_row(title, bar, f"{description} {done:.0f}/{total:.0f}")
        if self._said is None and self.compiling is None:
            bars.add_row(self._title, f"{time.monotonic() - self._started:.0f} s")
        return Group(_rounds(self._rows), bars) if self._rows else bars


_displays: list[_Display] = []


@contextmanager
def shown_live(title: str) -> Iterator[tuple[Progress, Watch]]:
    """Show a progress bar, and a table of an iteration's last rounds, if somebody watches.

    Work inside other work has no display of its own: only the outermost one is shown.
    """
    with _display(title, PATIENCE) as display:
        yield (no_progress, no_watch) if display is None else (display.show, display.watch)


@contextmanager
def _display(title: str, patience: float) -> Iterator[_Display | None]:
    draw = None if _displays else _outlet()
    if draw is None:
        yield None
        return
    display = _Display(title, draw, patience)
    _displays.append(display)
    try:
        yield display
    finally:
        _displays.remove(display)
        display.end()


@contextmanager
def _while_compiling(name: str, done: int, total: int) -> Iterator[None]:
    """Show which function is compiled, beside the work that waits for it or alone."""
    with _display("compiling", 0.0):
        display = _displays[0] if _displays else None
        if display is None:
            with _announce_compilation():
                yield
            return
        before, display.compiling = display.compiling, (name, done, total)
        try:
            yield
        finally:
            display.compiling = before


watched_by(_while_compiling)


@contextmanager
def _announce_compilation() -> Iterator[None]:
    """Let a line report the first compilation in this process that takes longer than `SILENCE`.

    A worker is silent: its output belongs to the answer, and its pool shows the progress.
    """
    timer = threading.Timer(SILENCE, _announce)
    timer.daemon = True
    if not in_worker():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


@cache
def _announce() -> None:
    """Print, once in a process, that it is compiling."""
    words = "workbench: compiling loops, which can take minutes; later starts find them on disk"
    print(words, file=sys.stderr, flush=True)


def _outlet() -> Draw | None:
    """The function that draws for the user; None if nobody watches."""
    python = sys.modules.get("IPython")
    shell = python.get_ipython() if python is not None else None
    if hasattr(shell, "kernel"):
        return _notebook(shell)
    return _terminal() if sys.stderr.isatty() else None


def _terminal() -> Draw:
    from rich.console import Console
    from rich.live import Live

    live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)

    def draw(picture: RenderableType | None) -> None:
        if picture is None:
            live.stop()
            return
        live.start()  # has no effect if it has started
        live.update(picture, refresh=True)

    return draw


def _notebook(shell: Any) -> Draw:
    from rich.console import Console

    name = {"display_id": f"workbench-{uuid.uuid4().hex}"}
    shown_before = False

    def draw(picture: RenderableType | None) -> None:
        nonlocal shown_before
        text = io.StringIO()
        if picture is not None:
            page = Console(file=text, width=WIDTH, color_system=None, force_jupyter=False)
            page.print(picture)
        content = {"text/plain": text.getvalue().rstrip()}
        shell.display_pub.publish(content, transient=name, update=shown_before)
        shown_before = True

    return draw


def _rounds(rows: Sequence[Row]) -> Table:
    """A table of the last rounds, one line each."""
    from rich.table import Table

    table = Table(*rows[-1], box=None)
    for column in table.columns:
        column.justify = "right"
    for row in rows[-SHOWN_ROUNDS:]:
        table.add_row(*map(row_entry, row.values()))
    return table
