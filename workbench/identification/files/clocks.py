"""Dates and clock times, converted to seconds from the first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date, datetime

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError

STAMP = re.compile(
    r"(?:(?P<days>\d+) days?,?\s*)?(?P<date>\d{1,4}[-./]\w{1,3}[-./]\d{1,4}|\d{8})?[T\s,]*"
    r"(?:(?P<a>\d+):(?P<b>\d\d?)(?::(?P<c>\d\d?))?(?:[.,](?P<f>\d+))?)?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[-+]\d\d:?\d\d|[-+]\d\d)?"
)
"""Days, a date, a clock time (hours, minutes, seconds, fraction), AM or PM, and a time zone; each
may be absent.
"""
ISO_DATE = re.compile(r"\d{4}-\d\d-\d\d")
ORDERS = {
    "year first": ("%Y{0}%m{0}%d", "%Y%m%d"),
    "day before month": ("%d{0}%m{0}%Y", "%d{0}%m{0}%y", "%d{0}%b{0}%Y"),
    "month before day": ("%m{0}%d{0}%Y", "%m{0}%d{0}%y"),
}
"""Orders of year, month and day in a date, with their formats; {0} is the separator."""
DAY = 86400.0
EVEN = 1e-3
"""Largest relative difference of steps at which an order of day and month counts as
evenly sampled.
"""


def as_seconds(cells: Sequence[str]) -> tuple[RealArray, str] | int:
    """Seconds from the first stamp of a column, and how the stamps were interpreted.

    Clock times without a date may run past midnight. If some cell is not a stamp, the index of the
    first such cell is returned instead.

    Raises
    ------
    InputError
        The stamps are ambiguous; the message says what to write.
    """
    if (dates := _iso_dates(cells)) is not None:
        return dates, "dates"
    found = []
    for place, cell in enumerate(cells):
        stamp = STAMP.fullmatch(cell.strip())
        if stamp is None or not (stamp["date"] or stamp["a"]):
            return place
        found.append(stamp)
    dated = [stamp["date"] is not None for stamp in found]
    if any(dated) != all(dated):
        return dated.index(not dated[0])
    if any(stamp["a"] and not stamp["c"] and not stamp["f"] and not dated[0] for stamp in found):
        raise InputError(
            f"{cells[0]!r} may be hours and minutes, or minutes and seconds: write hh:mm:ss"
        )
    clock = np.array([_clock(stamp) for stamp in found])
    if not all(dated):
        turns = np.cumsum(np.diff(clock, prepend=clock[:1]) < -DAY / 2)
        past = ", past midnight" if turns[-1] else ""
        return clock + DAY * turns - clock[0], f"clock{past}"
    written = [stamp["date"] for stamp in found]
    readings = {}
    for order in ORDERS:
        days = _days(written, order)
        if days is not None:
            readings[order] = (days - days[0]) * DAY + (clock - clock[0])
    return _only_possible_reading(readings, written[0])


def _iso_dates(cells: Sequence[str]) -> RealArray | None:
    """Seconds of ISO 8601 dates from the first, by pandas, which is fast; None for others."""
    if not cells or not ISO_DATE.match(cells[0]):
        return None
    import pandas

    try:
        dates = pandas.to_datetime(pandas.Series(cells), format="ISO8601", utc=True)
    except (ValueError, OverflowError):
        return None
    return (dates - dates.iloc[0]).dt.total_seconds().to_numpy()


def _clock(stamp: re.Match[str]) -> float:
    """Seconds of a stamp since midnight of its date, in UTC if it names a zone."""
    if stamp["a"] is None:
        return 0.0
    first, second = float(stamp["a"]), float(stamp["b"])
    fraction = float(f"0.{stamp['f']}") if stamp["f"] else 0.0
    if stamp["c"] is None and stamp["f"]:
        return 60 * first + second + fraction
    first += 24 * int(stamp["days"] or 0)
    if stamp["half"]:
        first = first % 12 + (12 if stamp["half"][0] in "pP" else 0)
    seconds = 3600 * first + 60 * second + float(stamp["c"] or 0) + fraction
    zone = stamp["zone"]
    if zone is None or zone[0] not in "+-":
        return seconds
    digits = zone[1:].replace(":", "").ljust(4, "0")
    offset = 3600 * int(digits[:2]) + 60 * int(digits[2:])
    return seconds + (offset if zone[0] == "-" else -offset)


def _days(written: Sequence[str], order: str) -> RealArray | None:
    """Day numbers of dates; None if a date does not have this order."""
    known: dict[str, int] = {}
    for one in set(written):
        mark = next((letter for letter in one if letter in "-./"), "")
        for form in ORDERS[order]:
            try:
                known[one] = datetime.strptime(one, form.format(mark)).toordinal()
                break
            except ValueError:
                continue
        if known.get(one, 0) < date(1900, 1, 1).toordinal():
            return None
    return np.array([known[one] for one in written], dtype=float)


def _only_possible_reading(readings: dict[str, RealArray], first: str) -> tuple[RealArray, str]:
    """The only possible reading of dates; of several readings the one with even steps."""
    if not readings:
        raise InputError(f"{first!r} is no date that is known: write it as 2024-01-31")
    seconds = list(readings.values())
    if all(np.array_equal(seconds[0], other) for other in seconds[1:]):
        return seconds[0], "dates"
    even = {}
    for order, one in readings.items():
        steps = np.diff(one)
        if steps.size > 1 and steps.min() > 0 and np.ptp(steps) <= EVEN * steps.mean():
            even[order] = one
    if len(even) != 1:
        raise InputError(f"{first!r} leaves open which is the day: write dates as 2024-01-31")
    order, one = next(iter(even.items()))
    return one, f"dates, {order}"
