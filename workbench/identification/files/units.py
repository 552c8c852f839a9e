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
POWER_OF_A_NUMBER = re.compile(r"\d\d|[\d)]\s*(\*\*|\^)")
"""What no unit contains, and a parser might compute for hours."""
SINGLE = frozenset("sVANmgTKWJhHCFΩ%°1-")
"""The units of one letter that name a column's unit: others, as t and u, name signals."""
WRITTEN = (
    (r"[−–]", "-"),
    (r"\b([mkMµμu]?N)\s?m\b", r"\1*m"),  # pint reads Nm as a number times a metre
    (r"\b(U|rev|r|revolutions|turns?|cycles?)/", "turn/"),
    (r"^(1/|/)(s|sec|min|h)$", r"turn/\2"),
    (r"^(s|sec|min|h)(\^|\*\*)?(-1|⁻¹)$", r"turn/\1"),
    (r"([A-Za-z])(-?\d)", r"\1**\2"),  # m/s2
    (r"^(rad|deg|mm|m)_s$|^(rad)ps$", r"\1\2/s"),
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
    for spelling in (text, text.lower(), text.capitalize()):
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
    known, wanted = _parsed(plain_unit(unit)), _parsed(to)
    if known is None or wanted is None:
        strange = unit if known is None else to
        raise InputError(f"the unit {strange!r} is not known; write it as {to!r} or alike")
    if known == wanted:
        return values
    if known.is_compatible_with("turn/s") and str(known) in ("1 / second", "1 / minute"):
        known = known * _registry().turn
    if not known.is_compatible_with(wanted) or "decibel" in str(known) + str(wanted):
        raise InputError(f"{unit!r} cannot be converted to {to!r}")
    result = _registry().Quantity(np.asarray(values, dtype=float), known).to(wanted).magnitude
    return np.asarray(result)
