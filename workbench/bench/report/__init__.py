"""Results as one HTML page that needs nothing else: no network, no file beside it.

The page shows what the folders hold, as stored: it recomputes nothing, and the same folders give
the same page.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import os
import re
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from workbench.bench.project import results_root
from workbench.bench.results import Run, stored_runs
from workbench.bench.store import CHECKSUMS, FAILED, PARTIAL, REFERENCE
from workbench.errors import ResultError

HERE = Path(__file__).parent


def report(
    root: str | Path | None = None, target: str | Path | None = None, pattern: str = "*"
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

    Returns
    -------
    Path of the page. It appears whole or not at all.

    Raises
    ------
    ResultError
        The page cannot be written there, or a results folder cannot be read.
    """
    root = Path(root) if root is not None else results_root()
    target = Path(target) if target is not None else root / "index.html"
    if any((folder / CHECKSUMS).exists() for folder in target.absolute().parents):
        raise ResultError(
            f"{target} would lie in a sealed results folder and break its checksums: "
            "name another target"
        )
    entries = list(_entries(root, target, pattern))
    content = _template().generate(
        entries=entries,
        pattern=pattern,
        total=math.fsum(entry.run.seconds["total"] for entry in entries),
        places={entry.run.key: entry.anchor for entry in reversed(entries) if not entry.failed},
        css=_asset("page.css"),
        js=_asset("page.js"),
    )
    _write(target, content)
    return target


def failed_runs(root: Path, pattern: str = "*") -> list[Run]:
    """The kept failures below a results folder whose problem fits a shell pattern."""
    aside = {root / PARTIAL, root / REFERENCE}
    runs = (
        Run(file.parent)
        for file in sorted(root.rglob(f"*{FAILED}/{CHECKSUMS}"))
        if not aside.intersection(file.parents)
    )
    return [run for run in runs if fnmatchcase(run.problem, pattern)]


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


# --- what the template shows ------------------------------------------------------------------


@dataclass(frozen=True)
class Entry:
    """A run as the page shows it.

    ``anchor`` is its place in the page, ``place`` its folder below the results folder, ``link``
    the way from the page to that folder.
    """

    run: Run
    failed: bool
    anchor: str
    place: str
    link: str | None

    @property
    def state(self) -> str:
        """What the certificate says, in a word."""
        if self.run.certificate is None:
            return "uncertified"
        return "holds" if self.run.holds else "fails"

    @property
    def headline(self) -> tuple[str, float] | None:
        """Name and value of the key metric."""
        name = self.run.info["headline"]
        return (name, float(self.run.metrics[name])) if name in self.run.metrics else None

    @property
    def gap(self) -> float | None:
        certificate = self.run.certificate
        return certificate.gap.value if certificate and certificate.gap else None

    @property
    def log(self) -> str:
        return self.run.log if (self.run.path / "log.txt").is_file() else ""

    @property
    def figures(self) -> Iterator[Picture]:
        """One by one: a page of many runs is written without holding all of them."""
        return (Picture(name, file) for name, file in self.run.figures.items())


@dataclass(frozen=True)
class Picture:
    """A figure to embed: the drawing or the pixels, whichever is smaller."""

    stem: str
    png: Path

    @property
    def name(self) -> str:
        return re.sub(r"[-_]+", " ", self.stem)

    @property
    def files(self) -> list[Path]:
        """The figure's files, the drawing first."""
        svg = self.png.with_suffix(".svg")
        return [svg, self.png] if svg.is_file() else [self.png]

    @property
    def source(self) -> Markup:
        """As a data URI; base64, so that nothing in it can be taken for markup."""
        file = min(self.files, key=lambda file: file.stat().st_size)
        kind = "svg+xml" if file.suffix == ".svg" else "png"
        code = base64.b64encode(file.read_bytes()).decode()
        return Markup(f"data:image/{kind};base64,{code}")  # no character of it needs escaping

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels: the page keeps the room before it draws the figure."""
        with self.png.open("rb") as stream:
            head = stream.read(24)
        if head[12:16] != b"IHDR":
            raise ResultError(f"{self.png} is no PNG file")
        width, height = struct.unpack(">II", head[16:24])
        return width, height


def _entries(root: Path, target: Path, pattern: str) -> Iterator[Entry]:
    """Every run with a place in the page, by problem, method and key."""
    runs = [(run, False) for run in stored_runs(root, pattern)]
    runs += [(run, True) for run in failed_runs(root, pattern)]
    runs.sort(key=lambda pair: (pair[0].problem, pair[0].method or "", pair[0].path.as_posix()))
    taken: set[str] = set()
    for run, failed in runs:
        anchor = f"{run.problem}/{run.key}{FAILED if failed else ''}"
        while anchor in taken:  # a folder copied by hand keeps its problem and key
            anchor += "'"
        taken.add(anchor)
        place = run.path.relative_to(root).as_posix()
        yield Entry(run, failed, anchor, place, _link(run.path, target.parent))


def _link(folder: Path, start: Path) -> str | None:
    """The way from one folder to another; None where it would spell out the whole machine."""
    folder, start = folder.absolute(), start.absolute()
    if folder.anchor != start.anchor or os.path.commonpath([folder, start]) == folder.anchor:
        return None
    return quote(Path(os.path.relpath(folder, start)).as_posix()) + "/"


# --- filters ----------------------------------------------------------------------------------


def number(value: Any, digits: int = 6) -> Markup:
    """A number to read, with the full one behind it.

    The class counts the characters before the point, by which the style sheet aligns points.
    """
    value = float(value)
    if math.isfinite(value):
        mantissa, _, exponent = f"{value:.{digits}g}".replace("-", "−").partition("e")
        power = str(int(exponent.replace("−", "-"))).replace("-", "−") if exponent else ""
    else:
        mantissa, power = {"nan": "NaN", "inf": "∞", "-inf": "−∞"}[str(value)], ""
    text = Markup('<data class="w{}" value="{}" title="{}">{}').format(
        min(len(mantissa.partition(".")[0]), 8), value, value, mantissa
    )
    return (
        text
        + (Markup("×10<sup>{}</sup>").format(power) if power else Markup(""))
        + Markup("</data>")
    )


def duration(seconds: float) -> str:
    """Seconds as people say them."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def text(value: Any) -> str:
    """A parameter, an option or a hash as text."""
    if value is None:
        return "none"
    return pathless(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))


_PATHS = re.compile(
    r"""
    (?:(?<=file://) | (?<![\w./\\<…+~-]))   # not inside a word, a URL or a relative path
    (?:/(?=[^/\s"'])|[A-Za-z]:[\\/]+)     # a root, with something below it
    (?:[^/\\\s"'<>|]+[/\\]+)+             # folders
    (?=[^/\\\s"'<>|])                     # and a name, which stays
    """,
    re.VERBOSE,
)
_QUOTED = re.compile(r"""(?<=File ")(?:/|[A-Za-z]:\\)[^"\n]*[/\\](?=[^"\n]+")""")
_KNOWN = {"site-packages": 1, "dist-packages": 1, "workbench": 0, "problems": 0}
"""Folders from which on a path says the same everywhere, and whether to leave them out."""


def pathless(words: str) -> str:
    """Words without the machine's folders: a page is sent to others, a trace has paths in it."""
    return _PATHS.sub(_short, _QUOTED.sub(_short, words))


def _short(match: re.Match[str]) -> str:
    parts = [part for part in re.split(r"[/\\]+", match.group()) if part]
    known = [at for at, part in enumerate(parts) if part in _KNOWN]
    rest = parts[known[-1] + _KNOWN[parts[known[-1]]] :] if known else []
    return "/".join(["…", *rest, ""])


def searchable(parameters: Mapping[str, Any]) -> str:
    """Parameters as the page's filter reads them."""
    return " ".join(f"{name}={text(value)}" for name, value in parameters.items())


def when(moment: str) -> str:
    """An ISO time to read."""
    return moment.replace("T", " ").replace("+00:00", " UTC")


def listed(need: str | Iterable[str]) -> list[str]:
    """A need's keys: there is one, or a list."""
    return [need] if isinstance(need, str) else list(need)


def csp_hash(source: str) -> str:
    """How a Content-Security-Policy names a script: no other one runs."""
    return "sha256-" + base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()


@cache
def _template() -> Any:
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for function in (number, duration, text, pathless, searchable, when, listed, csp_hash, quote):
        environment.filters[function.__name__] = function
    return environment.get_template("page.html.j2")


@cache
def _asset(name: str) -> Markup:
    return Markup((HERE / name).read_text(encoding="utf-8"))
