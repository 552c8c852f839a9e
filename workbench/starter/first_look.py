"""A first look at the records of a study: how they are sampled, and what is odd about them."""

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
"""Highest frequency that is used, times the sampling time; images distort higher ones."""
FEWEST_SAMPLES = math.ceil(FEWEST / UNDISTORTED)
"""Samples of the shortest record that has enough frequencies up to there."""
RISING = 0.5
"""Slope of the gain over frequency, in logarithms, that a plant with mass, lag or delay has not."""
END = 3.0
"""Part of the frequencies that count as the end: from the last one, divided by this, on."""
KNOWN, FEWEST_LINES = 5.0, 3
"""Gain over its standard deviation at a line that is known, and lines that tell a slope."""


@dataclass(frozen=True)
class FirstLook:
    """What the records of a study have in common.

    ``columns``: which of them is what, in words. ``period``: sampling time [s] of the first record.
    ``limits``: least and largest value of the input in all records. ``point``: where they rest.
    ``noise``: rms of the measurement noise. ``notes``: what is odd about that.
    """

    columns: str
    period: float
    limits: tuple[float, float]
    point: WorkingPoint
    noise: float
    notes: tuple[str, ...] = ()


def first_look(
    paths: Sequence[Path], input: str, output: str, time: str | None, record_dt: float | None
) -> FirstLook:
    """Read every record.

    Raises
    ------
    InputError
        A record is too short; or two files hold the same one: one plant that counts twice makes
        the spread too small. Or as `workbench.identification.read_record`.
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
    return FirstLook(columns, period, (low, high), point, rms_of_noise(records), notes)


def oddities(responses: Responses, files: Sequence[str]) -> tuple[str, ...]:
    """Sentences about responses that a plant with its input and its output in place has not.

    ``files`` are the names of the plants' records; they are told where some only are odd.
    """
    omega, gain = responses.omega, np.abs(responses.values)
    noise = np.zeros_like(gain) if responses.variance is None else np.sqrt(responses.variance)
    # Noise has no slope of the plant's, so that lines which it hides say nothing of it.
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
