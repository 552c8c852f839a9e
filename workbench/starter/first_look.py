"""A first look at the records of a study: how they are sampled, and what is peculiar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.experiments.alike import read_alike
from workbench.starter.first_choices import FEWEST
from workbench.starter.noise import rms_of_noise
from workbench.starter.rest import working_point
from workbench.synthesis import WorkingPoint
from workbench.uncertainty import Responses

UNDISTORTED = 0.1
"""Highest frequency used, as a fraction of the sampling rate; aliases distort higher ones."""
FEWEST_SAMPLES = math.ceil(FEWEST / UNDISTORTED)
"""Samples of the shortest record that has enough frequencies up to that limit."""
RISING = 0.5
"""Slope of log gain over log frequency that no plant with mass, lag or delay reaches."""
END = 3.0
"""The end of the band: frequencies above the last one divided by this factor."""
KNOWN, FEWEST_LINES = 5.0, 3
"""Least ratio of gain to standard deviation at a line that counts as known, and fewest known lines
that determine a slope.
"""


@dataclass(frozen=True)
class FirstLook:
    """Common properties of the records of a study.

    ``columns``: sentence that says which column is which. ``period``: sampling time [s] of the
    first record. ``limits``: least and largest value of the input in all records. ``point``:
    working point of the records. ``noise``: rms of the measurement noise. ``span``: range of the
    output in the record that moves it most. ``notes``: peculiarities of the records.
    """

    columns: str
    period: float
    limits: tuple[float, float]
    point: WorkingPoint
    noise: float
    span: float
    notes: tuple[str, ...] = ()


def first_look(
    paths: Sequence[Path], input: str, output: str, time: str | None, record_dt: float | None
) -> FirstLook:
    """Read every record.

    Raises
    ------
    InputError
        A record is too short; or two files hold the same record, since a plant that counts twice
        makes the spread too small. Or as `workbench.identification.read_record`.
    """
    read, alike = read_alike(paths, input, output, record_dt, time)
    records = [(one["u"].values, one["y"].values) for one in read]
    for path, (u, _) in zip(paths, records, strict=True):
        if u.size < FEWEST_SAMPLES:
            raise InputError(
                f"{path} has {u.size} samples; {FEWEST_SAMPLES} are needed at least, for "
                f"{FEWEST} frequencies up to {UNDISTORTED:g} of the sampling rate: take a longer "
                "record"
            )
    for k, (path, record) in enumerate(zip(paths, records, strict=True)):
        for other, earlier in zip(paths[:k], records, strict=False):
            if all(map(np.array_equal, record, earlier)):
                raise InputError(
                    f"{path} and {other} hold the same record: one plant would count twice; leave "
                    "one out"
                )
    period = float(f"{np.mean(np.diff(read[0]['time'].values)):.9g}")
    low = float(f"{min(u.min() for u, _ in records):.6g}")
    high = float(f"{max(u.max() for u, _ in records):.6g}")
    instants = f"at {1 / period:.6g} Hz" if time is None else f"time {time!r}"
    assumed = [one for one in (str(read[0].attrs["assumed"]), *alike) if one]
    columns = "; ".join([f"input {input!r}, output {output!r}, {instants}", *assumed])
    point, notes = working_point(read)
    span = float(max(np.ptp(y) for _, y in records))
    return FirstLook(columns, period, (low, high), point, rms_of_noise(records), span, notes)


def oddities(responses: Responses, files: Sequence[str]) -> tuple[str, ...]:
    """Sentences about properties that responses lack if input and output are in their places.

    ``files`` are the names of the plants' records; they are named if only some show the property.
    """
    omega, gain = responses.omega, np.abs(responses.values)
    noise = np.zeros_like(gain) if responses.variance is None else np.sqrt(responses.variance)
    # The slope of noise is not the plant's: lines that noise hides are left out.
    asked = (omega >= omega[-1] / END)[:, None] & (gain > KNOWN * noise)
    slopes = np.array(
        [
            np.polyfit(np.log(omega[lines]), np.log(one[lines]), 1)[0]
            if lines.sum() >= FEWEST_LINES
            else -np.inf
            for lines, one in zip(asked.T, gain.T, strict=True)
        ]
    )
    rising = [file for file, slope in zip(files, slopes, strict=True) if slope > RISING]
    if not rising:
        return ()
    where = "" if len(rising) == len(files) else f" in {', '.join(rising)} alone"
    return (
        f"the gain rises with frequency at the end{where}, as its power {slopes.max():.1f}: are "
        "input and output exchanged?",
    )
