"""Times of a recovery that are computed, or simulated apart from the loss."""

from __future__ import annotations

import numpy as np

from ...drive.actuator import SERIES_RESISTANCE
from ...drive.photo_diodes import S_CURVE_PEAK
from ...drive.tables import red_book
from ...laboratory.bench_setup import coil_gain, find_drive
from ..focus_search import BEGIN, RETREAT, WAIT, volts_per_metre
from ..track_jump.laws import Jump
from ..track_jump.runs import LANDING, LAWS, START, Setting
from .causes import SHARE

BLOCK = 1.0 / 75.0
"""Time [s] of a block of subcode, which tells the place on the disc (Standard ECMA-130)."""
JUMP = 3.0
"""Voltage [V] of a jump."""
CONTRAST = 0.6
"""Light between two tracks over that on a track, minus 1, as in cd/radial/track-jump."""
LONGEST_JUMP = 16
"""Longest jump [tracks] at once; the error's zeros can still be counted."""
TRIES = 6
"""Largest number of jumps."""


def least_search(drive: str, speed: float) -> float:
    """Time [s] that a search takes at least: the lens draws back, rests, and advances to the
    layer.

    The layer may be nearer by the disc's deviation, and the drive's gain differs from the nominal.
    """
    p = find_drive("focus", drive)
    gain = volts_per_metre() * p.Bl * coil_gain(p) / ((p.R + SERIES_RESISTANCE) * p.k)
    nearer = (SHARE * red_book("focus").deviation + S_CURVE_PEAK) / gain
    return -BEGIN / RETREAT + WAIT + (-BEGIN - nearer) / speed


def way_back(drive: str, tracks: int, seed: int) -> float:
    """Time [s] from the capture of a wrong track until the right one is read.

    The place is known when a whole block has been read, which takes one to two blocks. Then jumps
    are made until the track is the right one, each followed by reading the place. Jumps inwards are
    taken to land as those outwards do. NaN if the last jump misses too.
    """
    rng = np.random.default_rng(seed)
    setting, taken, left = Setting(CONTRAST, SHARE), 0.0, abs(tracks)
    for _ in range(TRIES):
        if not left:
            return taken
        taken += BLOCK * (1.0 + float(rng.uniform()))
        jump = Jump(min(left, LONGEST_JUMP), JUMP, START)
        landed = setting.landing(jump, LAWS[0], drive, int(rng.integers(2**31)), np.zeros(0))
        if not landed.held:
            return np.nan
        left = abs(left - jump.tracks - round(landed.off))
        taken += landed.time if np.isfinite(landed.time) else LANDING
    return taken if not left else np.nan
