"""Statistics of random experiments, whose numbers differ from one draw to the next.

An experiment is repeated with independent seeds, so that each of its numbers has a distribution
over the dimension ``draw``. One draw proves nothing. A claim is made only if it holds in nearly all
draws; methods are compared within each draw, with the same noise and the same defect.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from workbench._core.heavy_types import DataArray
from workbench.errors import InputError

DRAW = "draw"
"""Name of the dimension of repeated experiments."""
CENTRAL = 0.9
"""Share of the draws that lie within the interval that is reported."""
CLAIM_SHARE = 0.95
"""A claim "holds" if it is true in at least this share of the draws, and "fails" if it is true in
at most one minus this share. Between the two it is undecided.
"""
LEAST_COVERAGE_P = 1e-3
"""Significance level of the test whether intervals cover as often as they promise."""
SUMMARY = ("mean", "low", "high")
"""What is reported of a number over its draws: its mean, and the ends of its interval."""


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


def draws_summary(values: DataArray, *also: str) -> DataArray:
    """Mean and interval of a number over its draws, along the dimension ``summary``.

    Draws without a value (NaN) do not count; if no draw has a value, the summary is NaN.

    Parameters
    ----------
    values
        An array with the dimension ``draw``.
    also
        Other dimensions that count as draws too, such as ``drive``.

    Raises InputError if there is no dimension ``draw``.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import draws_summary
    >>> summary = draws_summary(xr.DataArray([1.0, 2.0, 3.0], dims="draw"))
    >>> summary.to_series().round(3).to_dict()
    {'mean': 2.0, 'low': 1.1, 'high': 2.9}
    """
    import xarray as xr

    missing = [name for name in (DRAW, *also) if name not in values.dims]
    if missing:
        raise InputError(f"array over {values.dims} has no dimension {missing[0]!r}")
    dims, tail = [DRAW, *also], (1.0 - CENTRAL) / 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of entries without a value in any draw
        ends = values.astype(float).quantile([tail, 1.0 - tail], dims).rename(quantile="summary")
        mean = values.mean(dims)
    every = [mean.expand_dims("summary"), ends.drop_vars("summary")]
    found = xr.concat(every, "summary").assign_coords(summary=list(SUMMARY))
    found.attrs |= {"units": values.attrs.get("units", "")}
    return found


def interval_text(summary: DataArray, *, form: str = "{:.3g}") -> str:
    """Mean and interval, as `draws_summary` gives them, in words: ``0.52 (0.41 to 0.66)``.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import draws_summary, interval_text
    >>> interval_text(draws_summary(xr.DataArray([1.0, 2.0, 3.0], dims="draw")))
    '2 (1.1 to 2.9)'
    """
    mean, low, high = (form.format(float(one)) for one in summary.transpose("summary"))
    return f"{mean} ({low} to {high})"


def share_of_draws(holds: DataArray, *kept: str) -> DataArray:
    """Share of the experiments (draws, drives, ...) in which a claim holds.

    The dimensions ``kept`` stay.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import share_of_draws
    >>> holds = xr.DataArray([[True, True], [True, False]], dims=("draw", "drive"))
    >>> share_of_draws(holds, "drive").values.tolist()
    [1.0, 0.5]
    """
    return holds.mean([name for name in holds.dims if name not in kept])


def share_interval(holds: DataArray, *kept: str, confidence: float = 0.99) -> DataArray:
    """Share of the experiments in which a claim holds, with its Clopper-Pearson interval.

    The interval is exact for independent experiments of one kind. Where they differ, as drives do,
    but their number of each kind is fixed, it is wider than need be.

    Parameters
    ----------
    holds
        Whether the claim holds, by experiment: at least one.
    kept
        Dimensions along which shares are told apart.
    confidence
        Probability with which the interval holds the true share.

    Returns the share and the ends of its interval, along the dimension ``summary``. Raises
    InputError without an experiment, and for a confidence outside 0 to 1.

    Source: C. J. Clopper, E. S. Pearson, Biometrika 26 (1934); W. Hoeffding, Annals of Mathematical
    Statistics 27 (1956) for experiments of several kinds.

    Examples
    --------
    >>> import xarray as xr
    >>> from workbench.study import share_interval
    >>> holds = xr.DataArray([True] * 10, dims="draw")
    >>> share_interval(holds).to_series().round(3).to_dict()
    {'mean': 1.0, 'low': 0.589, 'high': 1.0}
    """
    import xarray as xr
    from scipy import stats

    if not 0.0 < confidence < 1.0:
        raise InputError(f"confidence is {confidence}; it must lie between 0 and 1")
    spread = [name for name in holds.dims if name not in kept]
    many = int(np.prod([holds.sizes[name] for name in spread]))
    if not many:
        raise InputError("no experiment; the share needs one at least")
    true, tail = holds.sum(spread), (1.0 - confidence) / 2
    low = stats.beta.ppf(tail, true, many - true + 1)
    high = stats.beta.isf(tail, true + 1, many - true)
    ends = np.where(true > 0, low, 0.0), np.where(true < many, high, 1.0)
    every = [true / many, *(true.copy(data=end) for end in ends)]
    return xr.concat(every, "summary").assign_coords(summary=list(SUMMARY))


def verdict_of_share(share: float) -> str:
    """The verdict on a claim that holds in this share of the draws.

    "holds" for a share of at least `CLAIM_SHARE`, "fails" for one of at most 1 - `CLAIM_SHARE`,
    "undecided" between. Raises InputError for a share outside 0 to 1.

    Examples
    --------
    >>> from workbench.study import verdict_of_share
    >>> verdict_of_share(1.0), verdict_of_share(0.5), verdict_of_share(0.0)
    ('holds', 'undecided', 'fails')
    """
    if not 0.0 <= share <= 1.0:
        raise InputError(f"share of the draws is {share}; it must be from 0 to 1")
    if share >= CLAIM_SHARE:
        return "holds"
    return "fails" if share <= 1.0 - CLAIM_SHARE else "undecided"


def coverage_p(covered: DataArray, promised: float) -> DataArray:
    """Probability that intervals with the promised coverage cover no more draws than observed.

    This is a binomial test over the dimension ``draw``: a result below `LEAST_COVERAGE_P` means
    that the intervals are too narrow.

    Parameters
    ----------
    covered
        For each draw, whether the interval contains the truth; the draws must be independent.
    promised
        Probability of coverage that the intervals promise.

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
