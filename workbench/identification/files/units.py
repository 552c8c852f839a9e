"""Units as people write them, parsed and converted by pint.

A cycle differs from a radian: 1 Hz is 2 pi rad/s, and 1/min, as a unit of speed, is 1 rpm.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np

from workbench.errors import InputError

LONGEST = 24
"""Most characters of a text that can be a unit."""
SPELLINGS = {
    "nm": "Nm", "mnm": "mNm", "rads": "rad/s", "degc": "°C", "degf": "°F", "deg_s": "deg/s",
    "mv": "mV", "kv": "kV", "ma": "mA", "kpa": "kPa", "db": "dB", "hz": "Hz", "khz": "kHz",
    "mhz": "MHz", "ghz": "GHz", "rad_s": "rad/s", "radps": "rad/s", "m_s": "m/s", "mm_s": "mm/s",
}  # fmt: skip
"""Units as names write them in lower case, and their proper spelling."""
POWER_OF_A_NUMBER = re.compile(r"\d\d|[\d)]\s*(\*\*|\^)")
"""Matches a power of a number: no unit has one, and a parser might compute it for hours."""
SINGLE = frozenset("sVANmgTKWJhHCFΩ%°1-")
"""Single letters that can be a unit inside a column's name; others, such as t and u,
name signals.
"""
WRITTEN = (
    (r"[−–]", "-"),
    (r"\b([mkMµμu]?N)\s?m\b", r"\1*m"),  # pint reads Nm as a number times a metre
    (r"\b(U|rev|r|revolutions|turns?|cycles?)/", "turn/"),
    (r"^(1/|/)(s|sec|second|min|minute|h|hour)$", r"turn/\2"),
    (r"^(s|sec|min|h)(\^|\*\*)?(-1|⁻¹)$", r"turn/\1"),
    (r"([A-Za-z])(-?\d)", r"\1**\2"),  # m/s2
)
"""Spellings that pint does not know, with their replacements, applied in this order."""


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(on_redefinition="ignore")
    registry.define("hertz = turn / second = Hz")
    return registry


@lru_cache(maxsize=1000)
def _parsed(text: str) -> Any:
    """A pint unit; None if the text is not a unit."""
    if not 0 < len(text) <= LONGEST or POWER_OF_A_NUMBER.search(text):
        return None
    for pattern, known in WRITTEN:
        text = re.sub(pattern, known, text)
    for spelling in (text, text.lower()):
        try:
            return _registry().parse_units(spelling)
        except Exception:  # for other texts pint raises errors of every kind
            continue
    return None


def plain_unit(text: str) -> str:
    """A unit without surrounding brackets, and without the instant from which a time counts."""
    text = text.strip()
    if len(text) > 1 and text[0] + text[-1] in ("[]", "()"):
        text = text[1:-1].strip()
    return re.sub(r"\s+since\s.*", "", text)


def spelt(text: str) -> str:
    """A unit from the end of a name in its usual spelling; mHz and MHz stay different."""
    return text if text in ("mHz", "MHz") else SPELLINGS.get(text.lower(), text.lower())


def is_unit(text: str) -> bool:
    """Whether a cell or the end of a name is very likely a unit and nothing else."""
    if len(text) == 1:
        return text in SINGLE
    return bool(text) and _parsed(plain_unit(text)) is not None


def converted(values: np.ndarray, unit: str, to: str) -> np.ndarray:
    """Numbers, converted to another unit.

    Raises
    ------
    InputError
        A unit is unknown, or measures something else; the message says what is needed.
    """
    if unit == to:
        return values
    wanted = _parsed(to)
    tried = [_parsed(text) for text in (plain_unit(unit), spelt(plain_unit(unit)))]
    parsed = [one for one in tried if one is not None]
    if wanted is None or not parsed:
        strange = to if wanted is None else unit
        raise InputError(f"the unit {strange!r} is not known; write it as pint does, such as m/s")
    known = next((one for one in parsed if one.is_compatible_with(wanted)), parsed[0])
    if known == wanted:
        return values
    if not known.is_compatible_with(wanted) or "decibel" in str(known) + str(wanted):
        raise InputError(f"{unit!r} cannot be converted to {to!r}")
    result = _registry().Quantity(np.asarray(values, dtype=float), known).to(wanted).magnitude
    return np.asarray(result)
