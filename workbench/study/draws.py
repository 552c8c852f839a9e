"""Numbers of random experiments, which differ from one draw to the next.

An experiment is repeated with seeds that are independent of each other, and each of its numbers is
a distribution over the dimension ``draw``. One draw proves nothing: a claim is made where it holds
in nearly all draws, each compared with itself (the same noise, the same defect).
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from workbench._core.heavy_types import DataArray
from workbench.errors import InputError

DRAW = "draw"
"""The dimension of repeated experiments."""
CENTRAL = 0.9
"""Share of the draws that lie within the interval of a number."""
SURE = 0.95
"""Least share of the draws in which a claim holds that is made; above one minus it, and below it,
the claim is undecided."""
LEAST_COVERAGE_P = 1e-3
"""Significance of the test whether intervals cover as often as they promise."""
SUMMARY = ("mean", "low", "high")
"""What is told of a number over its draws: its mean, and the ends of its interval."""


def independent_seeds(rng: np.random.Generator, *shape: int) -> NDArray[np.int64]:
    """Seeds (shape), one for each experiment, drawn independently.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.study import independent_seeds
    >>> seeds = independent_seeds(np.random.default_rng(0), 2, 3)
    >>> seeds.shape, len(set(seeds.ravel().tolist()))
    ((2, 3), 6)
    """
    return rng.integers(2**31, size=shape)


def over_draws(values: DataArray, *also: str) -> DataArray:
    """Mean and interval of a number over its draws, along the dimension ``summary``.

    Draws without a value, NaN, do not count; where none has one the summary is NaN.

    Parameters
    ----------
    values
        An array with the dimension ``draw``.
    also
        Other dimensions whose entries are draws too, such as ``drive``.

    Raises InputError where there is no dimension ``draw``.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import over_draws
    >>> summary = over_draws(xr.DataArray([1.0, 2.0, 3.0], dims="draw"))
    >>> summary.to_series().round(3).to_dict()
    {'mean': 2.0, 'low': 1.1, 'high': 2.9}
    """
    import xarray as xr

    missing = [name for name in (DRAW, *also) if name not in values.dims]
    if missing:
        raise InputError(f"array over {values.dims} has no dimension {missing[0]!r}")
    dims, tail = [DRAW, *also], (1.0 - CENTRAL) / 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of what has no value in any draw
        ends = values.astype(float).quantile([tail, 1.0 - tail], dims).rename(quantile="summary")
        mean = values.mean(dims)
    every = [mean.expand_dims("summary"), ends.drop_vars("summary")]
    found = xr.concat(every, "summary").assign_coords(summary=list(SUMMARY))
    found.attrs |= {"units": values.attrs.get("units", "")}
    return found


def with_interval(summary: DataArray, *, form: str = "{:.3g}") -> str:
    """Mean and interval, as `over_draws` gives them, in words: ``0.52 (0.41 to 0.66)``.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import over_draws, with_interval
    >>> with_interval(over_draws(xr.DataArray([1.0, 2.0, 3.0], dims="draw")))
    '2 (1.1 to 2.9)'
    """
    mean, low, high = (form.format(float(one)) for one in summary.transpose("summary"))
    return f"{mean} ({low} to {high})"


def share_of_draws(holds: DataArray, *kept: str) -> DataArray:
    """Share of the experiments (draws, drives, ...) in which a claim holds, over dims ``kept``.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import share_of_draws
    >>> holds = xr.DataArray([[True, True], [True, False]], dims=("draw", "drive"))
    >>> share_of_draws(holds, "drive").values.tolist()
    [1.0, 0.5]
    """
    return holds.mean([name for name in holds.dims if name not in kept])


def claim_of(share: float) -> str:
    """What may be claimed of something that holds in a share of the draws.

    "holds" in `SURE` of them or more, "fails" in 1 - `SURE` or less, "undecided" between.
    Raises InputError for a share outside 0 to 1.

    Examples
    --------
    >>> from workbench.study import claim_of
    >>> claim_of(1.0), claim_of(0.5), claim_of(0.0)
    ('holds', 'undecided', 'fails')
    """
    if not 0.0 <= share <= 1.0:
        raise InputError(f"share of the draws is {share}; it must be from 0 to 1")
    if share >= SURE:
        return "holds"
    return "fails" if share <= 1.0 - SURE else "undecided"


def coverage_p(covered: DataArray, promised: float) -> DataArray:
    """Probability that intervals which keep their promise cover no more of the draws than these.

    A binomial test over the dimension ``draw``: below `LEAST_COVERAGE_P` the intervals are too
    narrow.

    Parameters
    ----------
    covered
        Whether an interval holds the truth, by draw; the draws must be independent.
    promised
        Probability with which it should.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import coverage_p
    >>> covered = xr.DataArray([True] * 16 + [False] * 4, dims="draw")
    >>> round(float(coverage_p(covered, promised=0.95)), 4)
    0.0159
    """
    from scipy import stats

    held = covered.sum(DRAW)
    chance = stats.binom.cdf(held, covered.sizes[DRAW], promised)
    return held.copy(data=np.asarray(chance))
