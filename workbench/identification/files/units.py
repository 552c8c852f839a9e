"""Units as people write them, understood and converted by pint.

A cycle is told apart from a radian: 1 Hz is 2 pi rad/s, and 1/min, as a unit of speed, is 1 rpm.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np

from workbench.errors import InputError

LONGEST = 24
"""Characters of the longest text that is taken for a unit."""
SPELLINGS = {
    "nm": "Nm", "mnm": "mNm", "rads": "rad/s", "degc": "°C", "degf": "°F", "deg_s": "deg/s",
    "mv": "mV", "kv": "kV", "ma": "mA", "kpa": "kPa", "db": "dB", "hz": "Hz", "khz": "kHz",
    "mhz": "MHz", "ghz": "GHz", "rad_s": "rad/s", "radps": "rad/s", "m_s": "m/s", "mm_s": "mm/s",
}  # fmt: skip
"""Units as names write them in small letters, and as they are."""
POWER_OF_A_NUMBER = re.compile(r"\d\d|[\d)]\s*(\*\*|\^)")
"""What no unit contains, and a parser might compute for hours."""
SINGLE = frozenset("sVANmgTKWJhHCFΩ%°1-")
"""The units of one letter that name a column's unit: others, as t and u, name signals."""
WRITTEN = (
    (r"[−–]", "-"),
    (r"\b([mkMµμu]?N)\s?m\b", r"\1*m"),  # pint reads Nm as a number times a metre
    (r"\b(U|rev|r|revolutions|turns?|cycles?)/", "turn/"),
    (r"^(1/|/)(s|sec|second|min|minute|h|hour)$", r"turn/\2"),
    (r"^(s|sec|min|h)(\^|\*\*)?(-1|⁻¹)$", r"turn/\1"),
    (r"([A-Za-z])(-?\d)", r"\1**\2"),  # m/s2
)
"""Ways of writing that pint does not know, and what it knows, in this order."""


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(on_redefinition="ignore")
    registry.define("hertz = turn / second = Hz")
    return registry


@lru_cache(maxsize=1000)
def _parsed(text: str) -> Any:
    """A unit of pint; None for what is none."""
    if not 0 < len(text) <= LONGEST or POWER_OF_A_NUMBER.search(text):
        return None
    for pattern, known in WRITTEN:
        text = re.sub(pattern, known, text)
    for spelling in (text, text.lower()):
        try:
            return _registry().parse_units(spelling)
        except Exception:  # pint raises errors of every kind for what is no unit
            continue
    return None


def plain_unit(text: str) -> str:
    """A unit without brackets around it, and without what a time counts from."""
    text = text.strip()
    if len(text) > 1 and text[0] + text[-1] in ("[]", "()"):
        text = text[1:-1].strip()
    return re.sub(r"\s+since\s.*", "", text)


def spelt(text: str) -> str:
    """A unit at the end of a name, in its usual letters; mHz and MHz stay apart."""
    return text if text in ("mHz", "MHz") else SPELLINGS.get(text.lower(), text.lower())


def is_unit(text: str) -> bool:
    """Whether a cell or the end of a name is a unit, and nothing else in all likelihood."""
    if len(text) == 1:
        return text in SINGLE
    return bool(text) and _parsed(plain_unit(text)) is not None


def converted(values: np.ndarray, unit: str, to: str) -> np.ndarray:
    """Numbers in another unit.

    Raises
    ------
    InputError
        A unit is not known, or measures another thing; the message says what is needed.
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
