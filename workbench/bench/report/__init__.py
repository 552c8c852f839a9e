"""Results as one HTML page that needs nothing else: no network, no file beside it.

The page shows what the folders hold, as stored: it recomputes nothing, and the same folders give
the same page.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from concurrent.futures import Executor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from workbench.bench.project import results_root
from workbench.bench.report import words
from workbench.bench.report.entries import entries, failed_runs
from workbench.bench.report.looks import looks
from workbench.bench.results import damaged
from workbench.bench.store import CHECKSUMS
from workbench.bench.trust.untrusted import possible_path
from workbench.errors import ResultError
from workbench.executor import InProcess, Progress, silent

__all__ = ["failed_runs", "report"]

HERE = Path(__file__).parent


def report(
    root: str | Path | None = None,
    target: str | Path | None = None,
    pattern: str = "*",
    *,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> Path:
    """Write the runs below a results folder, failures among them, as one HTML page.

    Parameters
    ----------
    root
        The results folder (default: the project's).
    target
        The page (default: ``index.html`` in the results folder).
    pattern
        Shell pattern of the problems to show.
    executor
        Where the figures are drawn, a run to a task (default: in this process).
    progress
        Told how many runs are drawn.

    Returns
    -------
    Path of the page. It appears whole or not at all.

    Raises
    ------
    ResultError
        The page cannot be written there, or a results folder cannot be read.
    """
    root = possible_path(root) if root is not None else results_root()
    target = possible_path(target) if target is not None else root / "index.html"
    if any((folder / CHECKSUMS).exists() for folder in target.absolute().parents):
        raise ResultError(
            f"{target} would lie in a sealed results folder and break its checksums: "
            "name another target"
        )
    shown = list(entries(root, target, pattern))
    drawn = looks([entry.run.path for entry in shown], executor or InProcess(), progress)
    content = _template().generate(
        entries=shown,
        looks={entry.anchor: one for entry, one in zip(shown, drawn, strict=True)},
        pattern=pattern,
        left_out={
            folder.relative_to(root).as_posix(): reason for folder, reason in damaged(root).items()
        },
        total=math.fsum(entry.run.seconds["total"] for entry in shown),
        places={entry.run.key: entry.anchor for entry in reversed(shown) if not entry.failed},
        css=_asset("page.css"),
        js=_asset("page.js"),
    )
    _write(target, content)
    return target


def _write(target: Path, content: Iterable[str]) -> None:
    """Write beside, then rename in: whoever reads the old page never sees half a new one."""
    partial = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(content)
        partial.replace(target)
    except OSError as error:
        reason = f"{error.strerror}: {error.filename}"
        raise ResultError(f"cannot write the page {target}: {reason}") from None
    finally:
        with suppress(OSError):
            partial.unlink()


@cache
def _template() -> Any:
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for name in (
        "breakable",
        "csp_hash",
        "duration",
        "listed",
        "number",
        "pathless",
        "searchable",
        "tables_as_html",
        "text",
        "when",
    ):
        environment.filters[name] = getattr(words, name)
    environment.filters["quote"] = quote
    return environment.get_template("page.html.j2")


@cache
def _asset(name: str) -> Markup:
    return Markup((HERE / name).read_text(encoding="utf-8"))
