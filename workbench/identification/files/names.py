"""Names of columns, and the units inside these names."""

from __future__ import annotations

import re
from typing import Literal

from workbench.identification.files.units import is_unit, plain_unit, spelt

Role = Literal["time", "frequency", "signal", "magnitude", "phase"]
"""Meaning of a column; it decides which endings of a name count as units."""
IN_BRACKETS = re.compile(r"(.*[^\s/])\s*/?\s*[\[(<]([^\])>]*)[\])>]")
"""A name with its unit, such as ``torque [Nm]``."""
A_COLUMN = re.compile(r"(?<=\S)\[\d+\]$")
"""The end of a name for one of several columns, such as ``y[0]``; in ``gain [1]`` it is a unit."""
RATE = re.compile(
    r"(.+?)[_ .-]((?:rad|deg|rev|[uµμmck]?m|m?l|kg)/(?:s|min|h)(?:\^?2|²)?)", re.IGNORECASE
)
"""A name with a unit that has a stroke itself, such as ``speed_rad/s``: not speed_rad in s."""
AFTER_A_STROKE = re.compile(r"([^/]*[^/\s])\s*/\s*(.+)")
"""A name with its unit, such as ``t/ms`` (ISO 80000-1)."""
AFTER_A_WORD = re.compile(r"(.*\S)\s*(?:,|\bin\b)\s*(\S+)")
"""A name with its unit, such as ``time, s`` and ``time in ms``."""
SUFFIXES: dict[str, str] = {
    "time": "ns|us|µs|μs|ms|msec|usec|s|sec|secs|seconds?|min|minutes?|h|hr|hours?|d|days?|"
    "millis|milliseconds?|micros|microseconds?|nanos|nanoseconds?",
    "frequency": "hz|khz|mhz|ghz|rad_s|rads|radps|rpm",
    "signal": "rpm|nm|mnm|rad|deg|degc|degf|rad_s|radps|deg_s|mv|kv|ma|mm|um|m_s|mm_s|kpa|mbar|psi|"
    "hz|khz",
    "magnitude": "db",
    "phase": "deg|degrees?|rad|radians?",
}  # fmt: skip
"""Units at the end of a name, after an underscore; single letters only if the role is known.

A unit that is not written in lower case, such as kN, also needs its spelling in `SPELLINGS`.
"""
JOINED = re.compile(
    r"(t|ti?me|(?:time)?stamp|elapsed|uptime|zeit)?"
    r"(ms|us|µs|μs|ns|[mu]sec|sec|seconds?|minutes?|hours?|(?:milli|micro|nano)(?:s|seconds?))",
    re.IGNORECASE,
)
"""Names of times that consist of their unit, or end with it, such as ``timeMs``."""


def split_name(name: str, role: Role = "signal") -> tuple[str, str | None]:
    """A name without its unit, and the unit: ``("t", "ms")`` for ``"t [ms]"`` and ``"t_ms"``."""
    if (found := IN_BRACKETS.fullmatch(name)) and not A_COLUMN.search(name):
        return found[1], found[2].strip() or None
    if role in ("frequency", "signal") and (rate := RATE.fullmatch(name)):
        return rate[1], spelt(rate[2])
    for pattern in (AFTER_A_STROKE, AFTER_A_WORD):
        if (found := pattern.fullmatch(name)) and is_unit(plain_unit(found[2])):
            return found[1], plain_unit(found[2])
    suffix = re.compile(rf"(.+?)[_ .-]({SUFFIXES[role]})", re.IGNORECASE).fullmatch(name)
    if suffix:
        return suffix[1], spelt(suffix[2])
    if role == "time" and (joined := JOINED.fullmatch(name)):
        return joined[1] or name, spelt(joined[2])
    return name, None
