"""The report of a record: its assumptions, results of their tests, and findings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments, as_experiments
from workbench.identification.record_tests.report import RecordReport


def record_report(
    u: Any,
    y: Any,
    *,
    r: Any = None,
    dt: float | None = None,
    direct: bool = True,
    order: int | None = None,
) -> RecordReport:
    """Report of a record: which assumptions hold, which are untested, and what to do.

    Every function that estimates something from a record first makes this report, and refuses the
    record if a finding forbids its use. Assumptions are, among others: an open loop (the input does
    not depend on the noise of the output), an input that excites enough, and samples taken at even
    instants without later processing.

    Parameters
    ----------
    u, y
        Inputs and outputs, as `as_experiments` takes them: arrays (N,) or (N, channels), labelled
        arrays, tables, or lists with one of them for each experiment; or a Dataset as u, y None.
    r
        The external signal that drove a closed loop, such as a set-point, (N,) or (N, channels);
        None: not recorded. With it the loop may be closed, and methods that use it are valid.
    dt
        Sampling time [s]; None: that of the labels, or 1.
    direct
        Whether y may respond to u within the same sample. False if the plant, or its converters,
        delay by at least a sample.
    order
        Order of the model to be estimated; None: not known yet.

    Returns
    -------
    RecordReport
        Its ``findings`` say what was found, where, how strong it is, what to do, and whether it
        forbids the use of the record; its ``sentences`` say what was tested.

    Raises
    ------
    InputError
        As `as_experiments`; or the excitation r is not valid.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import record_report
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> report = record_report(u, np.convolve(u, [0.5, 0.3])[:500])
    >>> [finding for finding in report.findings if finding.forbids]
    []
    """
    if not isinstance(direct, bool):
        raise InputError(f"direct is {direct!r}; it must be True or False")
    record = as_experiments(u, y, dt=dt)
    if r is not None:
        record = record.driven_by(r)
    return record.report_for(direct=direct, order=order)


def report_of_arrays(
    u: RealArray,
    y: RealArray,
    assume: str | Sequence[str],
    dt: float = 1.0,
    *,
    r: RealArray | None = None,
    name: str = "the record",
) -> RecordReport:
    """Report of a named record of finite arrays u (N, nu), y (N, ny), r (N, nr).

    ``assume`` names assumptions that the user vouches for. Raises `InputError` if a finding forbids
    the use of the record.
    """
    report = Experiments(u, y, dt=dt, excitation=r).report.assuming(assume)
    report.need_usable(name)
    return report
