"""Formats of the report: numbers, times, paths and tables as text or markup."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable
from typing import Any

from markupsafe import Markup


def number(value: Any, digits: int = 6) -> Markup:
    """A rounded number, with the full one behind it.

    The class counts the characters before the decimal point; the style sheet aligns points by it.
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


def breakable(name: str) -> Markup:
    """A name in which lines may break after underscores only."""
    return Markup("_<wbr>").join(name.split("_"))


def duration(seconds: float) -> str:
    """A duration [s] as people say it."""
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
"""Folders from which a path is the same on every machine, and whether to remove the
folder itself.
"""


def pathless(words: str) -> str:
    """A text without the machine's folders: pages are sent to others, and traces hold paths."""
    return _PATHS.sub(_short, _QUOTED.sub(_short, words))


def _short(match: re.Match[str]) -> str:
    parts = [part for part in re.split(r"[/\\]+", match.group()) if part]
    known = [at for at, part in enumerate(parts) if part in _KNOWN]
    rest = parts[known[-1] + _KNOWN[parts[known[-1]]] :] if known else []
    return "/".join(["…", *rest, ""])


def when(moment: str) -> str:
    """An ISO time in readable form."""
    return moment.replace("T", " ").replace("+00:00", " UTC")


def listed(need: str | Iterable[str]) -> list[str]:
    """A need's keys as a list; it has one, or a list."""
    return [need] if isinstance(need, str) else list(need)


def csp_hash(source: str) -> str:
    """Hash of a script for a Content-Security-Policy, which lets no other script run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()
