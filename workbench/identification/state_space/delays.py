"""Delays of inputs, as given by the user or as estimated from a record."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import chi2

from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.regression import lagged_triangle
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.record_tests.delay import delays as seen_delays
from workbench.identification.record_tests.record import RecordData
from workbench.identification.state_space.gaps import bridged
from workbench.input_checks import need_whole

LONGEST_DELAY = 100
"""Longest delay [samples] that the autoregressions consider; in short records it is shorter.

For a longer delay, the record's impulse responses first locate it to within this."""
FIRST_SAMPLES = 100_000
"""Number of leading samples in which delays are searched."""
REGRESSORS = 4
"""Number of lags of each input and output in the autoregressions that are compared."""
TIE = 1e-6
"""Difference of log determinants that counts as rounding."""
CHANCE = 0.9
"""Probability with which the correct delay fits no worse, by chance, than this allows."""
LEAST_SHARE = 1e-12
"""Errors below this share of the outputs' variance count as rounding."""
ROUNDS = 3
"""Number of rounds in which each input's delay is searched again."""


def checked_delays(delay: Any, record: Experiments) -> tuple[int, ...]:
    """Delays (nu,) [samples] as given; raises `InputError` for invalid ones.

    "estimate" counts as no delay here.
    """
    nu = record.u.shape[1]
    if isinstance(delay, str):
        if delay != "estimate":
            raise InputError(f'delay_samples is {delay!r}; give whole samples, or "estimate"')
        return (0,) * nu
    given = list(delay) if np.iterable(delay) else [delay] * nu
    if len(given) != nu:
        raise InputError(f"{len(given)} delays are given for {nu} inputs; give one for each")
    for each in given:
        need_whole(each, "a delay [samples]")
        if each < 0:
            raise InputError(f"a delay is {each} samples; it must not be negative")
    longest = max(len(u) for u, _ in record.pieces())
    if given and max(given) > longest // 2:
        raise InputError(
            f"a delay of {max(given)} samples is more than half of the longest experiment, "
            f"{longest} samples; give a shorter delay"
        )
    return tuple(int(each) for each in given)


def estimated_delays(record: Experiments) -> tuple[int, ...]:
    """The longest delays (nu,) [samples] with which autoregressions with inputs fit best.

    Delays whose fit is not worse than chance explains count as equally good. The number of
    regressors is the same for all delays. The delays of several inputs are searched one after
    another. For delays longer than `LONGEST_DELAY` the search starts a little before the response
    appears.

    Source: L. Ljung, System Identification, 2nd ed., 1999, section 17.3.
    """
    record = record.part(0, min(len(record), FIRST_SAMPLES))
    sure = _sure_delays(record)
    if not any(sure):
        return _nearby_delays(record)
    nearby = _nearby_delays(record.delayed(sure))
    return tuple(first + more for first, more in zip(sure, nearby, strict=True))


def _sure_delays(record: Experiments) -> tuple[int, ...]:
    """Samples (nu,) during which no output responds to an input, if long; else 0."""
    seen = RecordData(
        record.u, record.y, None, record.starts, record.dt, record.inputs, record.outputs
    )
    found = []
    for j in range(record.u.shape[1]):
        waits = [one for one in seen_delays(seen) if one.input == j and one.tested]
        late = [0 if one.least is None or one.most is None else one.least for one in waits]
        least = min(late, default=0)
        found.append(least - LONGEST_DELAY // 2 if least > LONGEST_DELAY else 0)
    return tuple(found)


def _nearby_delays(record: Experiments) -> tuple[int, ...]:
    """Delays (nu,) [samples], up to `LONGEST_DELAY`, of the best autoregressions with inputs."""
    nu, ny = record.u.shape[1], record.y.shape[1]
    longest = min(LONGEST_DELAY, len(record) // (4 * (nu + ny)) - REGRESSORS)
    if longest < 1:
        return (0,) * nu
    record = bridged(record, past=longest + REGRESSORS)
    scaling = Scaling.of(record)
    pieces = [scaling.scaled(*piece) for piece in record.pieces()]
    lagged = lagged_triangle(pieces, longest + REGRESSORS, nu + ny)
    r, m = lagged.factor, nu + ny
    if lagged.rows < len(r):
        raise InputError(
            f"too few stretches of {longest + REGRESSORS + 1} samples have no missing one to "
            "estimate delays: give delay_samples"
        )
    columns = {0: r.shape[1] - m} | {lag: 1 + (lag - 1) * m for lag in range(1, lagged.past + 1)}
    outputs = [columns[lag] + nu + i for lag in range(1, REGRESSORS + 1) for i in range(ny)]

    def loss(delays: Sequence[int]) -> float:
        inputs = [columns[delays[j] + k] + j for j, k in product(range(nu), range(REGRESSORS + 1))]
        basis = np.linalg.qr(r[:, [0, *outputs, *inputs]])[0]
        now = r[:, -ny:]
        left = now - basis @ (basis.T @ now)
        covariance = (left.T @ left) / lagged.rows + LEAST_SHARE * np.eye(ny)
        return float(np.linalg.slogdet(covariance)[1])

    worse = float(chi2.ppf(CHANCE, ny)) / max(lagged.rows, 1) + TIE
    found = [0] * nu
    for _ in range(ROUNDS if nu > 1 else 1):
        for j in range(nu):
            losses = np.array([loss([*found[:j], d, *found[j + 1 :]]) for d in range(longest + 1)])
            found[j] = int(np.flatnonzero(losses <= losses.min() + worse)[-1])
    return tuple(found)
