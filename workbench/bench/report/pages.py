"""Pages of a report, filled in from templates."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from workbench.bench.report import words
from workbench.bench.report.entries import ReportEntry, as_json, searchable
from workbench.bench.report.kept import MARK
from workbench.bench.report.markdown_tables import tables_as_html

HERE = Path(__file__).parent
PICTURES = "'self' file: data:"
"""Sources from which pages may load pictures: their own folder, on a disk or on a server."""


@dataclass(frozen=True)
class FigureView:
    """A figure on a page: its name, the address and size of its pixels, and its SVG."""

    name: str
    source: str | Markup
    width: int
    height: int
    inline: Markup | None = None


@dataclass(frozen=True)
class RunView:
    """Content of the page of a run, besides the run itself.

    ``methods`` are those drawn in its figures; ``folder`` is the relative path of its results
    folder, and ``index`` that of the table of all runs, if they exist.
    """

    entry: ReportEntry
    figures: Sequence[FigureView]
    methods: Sequence[str]
    tables: Mapping[str, str]
    missing: Sequence[str]
    places: Mapping[str, str]
    folder: str | None
    index: str | None


def run_page(view: RunView) -> str:
    """The page of a run."""
    return _page("run.html.j2", ["run.js"], view=view, entry=view.entry, run=view.entry.run)


def index_page(
    entries: Sequence[ReportEntry],
    thumbnails: Mapping[str, FigureView],
    pattern: str,
    left_out: Mapping[str, str],
) -> str:
    """The page that lists all runs.

    Parameters
    ----------
    entries
        The runs, in the order of their themes.
    thumbnails
        Small figures, by the names of the runs' pages.
    pattern
        Shell pattern of the runs' problems.
    left_out
        Folders that cannot be read, with the reasons.
    """
    return _page(
        "index.html.j2",
        ["listing.js", "index.js"],
        entries=entries,
        thumbnails=thumbnails,
        pattern=pattern,
        left_out=left_out,
        themes=Counter(entry.theme for entry in entries),
        total=math.fsum(entry.run.seconds["total"] for entry in entries),
    )


def link(folder: Path, start: Path) -> str | None:
    """The relative path from one folder to another; None if it would reveal the whole machine."""
    folder, start = folder.absolute(), start.absolute()
    if folder.anchor != start.anchor or os.path.commonpath([folder, start]) == folder.anchor:
        return None
    return quote(Path(os.path.relpath(folder, start)).as_posix()) + "/"


def _page(template: str, scripts: Sequence[str], **content: Any) -> str:
    script = Markup("\n").join(asset(name) for name in scripts)
    return str(
        _environment()
        .get_template(template)
        .render(css=asset("page.css"), js=script, mark=Markup(MARK), pictures=PICTURES, **content)
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(HERE / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for name in (
        "breakable", "csp_hash", "duration", "listed", "number", "pathless", "text", "when",
    ):  # fmt: skip
        environment.filters[name] = getattr(words, name)
    environment.filters["as_json"] = as_json
    environment.filters["quote"] = quote
    environment.filters["searchable"] = searchable
    environment.filters["tables_as_html"] = tables_as_html
    return environment


@cache
def asset(name: str) -> Markup:
    """The text of a style sheet or script of the pages."""
    return Markup((HERE / "templates" / name).read_text(encoding="utf-8"))
