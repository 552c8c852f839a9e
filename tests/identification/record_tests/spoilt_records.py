"""What may be wrong with a record: each function spoils a good one, and names the finding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from workbench.identification.record_tests.record import RecordData

NOISE = 0.02
"""Standard deviation of the noise, over that of the output."""


def good_record(rng, n=3000, excitation="binary", wait=0, sensor=None) -> RecordData:
    """A record of y_(k+1) = 0.8 y_k + 0.2 u_(k - wait), after what a sensor makes of it."""
    u = rng.standard_normal(n)
    if excitation == "binary":
        u = np.repeat(rng.choice([-1.0, 1.0], n // 5 + 1), 5)[:n]
    elif excitation == "set points":
        u = np.repeat(rng.uniform(20, 80, n // 60 + 1).round(), 60)[:n]
    y = lfilter([0, 0.2], [1, -0.8], np.concatenate([np.zeros(wait), u[: n - wait]]))
    y = y + NOISE * y.std() * rng.standard_normal(n)
    y = y if sensor is None else sensor(y)
    return RecordData(u[:, None], y[:, None], None, (0,), 0.1, ("valve",), ("flow",), order=2)


def with_output(record, y):
    return replace(record, y=y[:, None])


def two_equal_inputs(rng):
    record = good_record(rng)
    return replace(record, u=np.hstack([record.u, record.u]), inputs=("a", "b"))


def nearly_collinear_inputs(rng):
    record = good_record(rng, excitation="white")
    other = 3 * record.u + 1e-6 * rng.standard_normal(record.u.shape)
    return replace(record, u=np.hstack([record.u, other]), inputs=("a", "b"))


def one_sine(rng):
    n = 3000
    u = np.sin(2 * np.pi * rng.uniform(0.01, 0.1) * np.arange(n))
    y = lfilter([0, 0.2], [1, -0.8], u)
    y = y + NOISE * y.std() * rng.standard_normal(n)
    return RecordData(u[:, None], y[:, None], None, (0,), 0.1, ("valve",), ("flow",), order=2)


def clipped_sensor(rng):
    level = rng.uniform(0.4, 1.5)
    kind = str(rng.choice(["binary", "white", "set points"]))
    return good_record(
        rng,
        excitation=kind,
        sensor=lambda y: np.clip(y, *(y.mean() + level * y.std() * np.array([-1, 1]))),
    )


def ten_spikes(rng):
    def sensor(y):
        y = y.copy()
        at = rng.choice(len(y), 10, replace=False)
        y[at] += rng.choice([-1, 1], 10) * rng.uniform(3, 30, 10) * y.std()
        return y

    kind = str(rng.choice(["binary", "white", "set points"]))
    return good_record(rng, excitation=kind, sensor=sensor)


def flagged_outputs(rng):
    flag = rng.choice([-9999.0, 9999.0, 32767.0, 0.0])
    offset = 300.0 if flag == 0 else 0.0

    def sensor(y):
        y = y + offset
        y[rng.choice(len(y), int(rng.integers(2, 40)), replace=False)] = flag
        return y

    return good_record(rng, sensor=sensor)


def flagged_rows(rng):
    record = good_record(rng, excitation="white")
    at = rng.choice(len(record.u), 12, replace=False)
    u, y = record.u.copy(), record.y.copy()
    u[at] = y[at] = -9999.0
    return replace(record, u=u, y=y)


def flagged_input(rng):
    record = good_record(rng, excitation="white")
    u = record.u.copy()
    u[rng.choice(len(u), 12, replace=False)] = -9999.0
    return replace(record, u=u)


def long_delay(rng):
    return good_record(rng, wait=int(rng.integers(101, 200)))


def longer_delay(rng):
    return good_record(rng, n=20_000, wait=int(rng.integers(300, 1500)))


def stuck_sensor(rng):
    def sensor(y):
        y = np.round(y / 1e-3) * 1e-3
        start = int(rng.integers(1000, 2500))
        y[start : start + 150] = y[start]
        return y

    return good_record(rng, sensor=sensor)


def coarse_counts(rng):
    return good_record(rng, sensor=lambda y: np.round(y / y.std() * 0.7) * y.std() / 0.7)


def drifting_output(rng):
    return good_record(rng, sensor=lambda y: y + 1.5 * y.std() * np.linspace(0, 1, len(y)))


def short_record(rng):
    record = good_record(rng, excitation="binary")
    y = lfilter([0, 1e-3], [1, -0.999], record.u[:, 0])
    return with_output(record, y + 0.01 * y.std() * rng.standard_normal(len(y)))


def missing_outputs(rng):
    def sensor(y):
        y = y.copy()
        y[rng.random(len(y)) < 0.05] = np.nan
        return y

    return good_record(rng, sensor=sensor)


def distorted_output(rng):
    period, count = 500, 6
    spectrum = np.zeros(period // 2 + 1, complex)
    lines = np.arange(1, 60, 2)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(lines.size))
    one = np.fft.irfft(spectrum, period)
    u = np.tile(one / one.std(), count)
    y = lfilter([0, 0.2], [1, -0.8], u)
    y = y + 0.1 * y**2 / y.std() + NOISE * y.std() * rng.standard_normal(len(y))
    return RecordData(u[:, None], y[:, None], None, (0,), 0.1, ("valve",), ("flow",))


def still_input(rng):
    record = good_record(rng, n=6000)
    u = record.u.copy()
    u[300:] = 0.0
    y = lfilter([0, 0.2], [1, -0.8], u[:, 0])
    y = y + 0.01 * rng.standard_normal(len(y))
    return replace(record, u=u, y=y[:, None])


def one_move(rng):
    record = good_record(rng)
    u = (np.arange(3000.0) >= 1000)[:, None]
    y = lfilter([0, 0.2], [1, -0.8], u[:, 0]) + 0.01 * rng.standard_normal(3000)
    return replace(record, u=u.astype(float), y=y[:, None])


def uneven_instants(rng):
    record = good_record(rng)
    return replace(record, times=np.cumsum(0.1 * rng.uniform(0.5, 1.5, len(record.u))))


def missing_rows(rng):
    record = good_record(rng)
    kept = np.delete(np.arange(len(record.u)), [500, 501, 1700])
    return replace(record, u=record.u[kept], y=record.y[kept], times=0.1 * kept)


SPOILT = {
    two_equal_inputs: "collinear inputs",
    nearly_collinear_inputs: "collinear inputs",
    one_sine: "excitation",
    clipped_sensor: "clipped",
    ten_spikes: "spikes",
    flagged_outputs: "flags",
    flagged_rows: "flags",
    flagged_input: "flags",
    long_delay: "delay",
    longer_delay: "delay",
    stuck_sensor: "stuck",
    coarse_counts: "coarse steps",
    drifting_output: "drift",
    short_record: "short record",
    missing_outputs: "gaps",
    distorted_output: "distortion",
    still_input: "excitation",
    one_move: "excitation",
    uneven_instants: "uneven samples",
    missing_rows: "missing rows",
}
"""What spoils a record, and the kind of the finding that must say so."""

FORBIDDING = {
    two_equal_inputs, nearly_collinear_inputs, flagged_outputs, flagged_rows, flagged_input,
    uneven_instants, missing_rows,
}  # fmt: skip
"""Those that leave nothing to estimate, with a way out in the user's hand."""
