"""One or several records of one plant, with sampling time, names and units.

Arrays, lists of arrays, labelled arrays and tables are accepted. A missing sample of an output
stays missing; a missing sample of an input ends an experiment there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.signals import Signals, as_signals
from workbench.identification.record_tests.record import RecordData
from workbench.identification.record_tests.report import RecordReport, as_names, reported
from workbench.input_checks import need_positive

SamplesAlong = Literal["rows", "columns"]
MISSING_SHARE = 0.5
"""Largest share of an output's samples that may be missing."""


@dataclass(frozen=True, eq=False)
class Experiments:
    """One or more experiments on a plant: inputs u (N, nu), outputs y (N, ny) and their clock.

    Parameters
    ----------
    u, y
        Finite inputs; NaN in y is a missing sample.
    starts
        First sample of each experiment, rising from 0.
    dt
        Sampling time [s].
    inputs, outputs, input_units, output_units
        Names and units of the channels.
    excitation
        External signal (N, nr) that drove a closed loop, if it was recorded.
    assumed
        Assumptions that the user vouches for, whatever the record's report says.
    times
        Time stamps (N,) [s] of the samples, for the report; None: there are none.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import Experiments
    >>> record = Experiments(np.ones((5, 1)), np.arange(5.0)[:, None], dt=0.1)
    >>> record.starts, record.dt, record.missing
    ((0,), 0.1, 0)
    """

    u: RealArray
    y: RealArray
    _: KW_ONLY
    starts: tuple[int, ...] = (0,)
    dt: float = field(default=1.0, kw_only=True)
    inputs: tuple[str, ...] = field(default=(), kw_only=True)
    outputs: tuple[str, ...] = field(default=(), kw_only=True)
    input_units: tuple[str, ...] = field(default=(), kw_only=True)
    output_units: tuple[str, ...] = field(default=(), kw_only=True)
    excitation: RealArray | None = field(default=None, kw_only=True)
    assumed: tuple[str, ...] = field(default=(), kw_only=True)
    times: RealArray | None = field(default=None, kw_only=True, repr=False)

    def __len__(self) -> int:
        return len(self.u)

    @property
    def labels(self) -> dict[str, Any]:
        """Sampling time, names and units, which a model of the record has too."""
        names = ("dt", "inputs", "outputs", "input_units", "output_units")
        return {name: getattr(self, name) for name in names}

    @property
    def missing(self) -> int:
        """Number of missing samples in the outputs."""
        return int(np.isnan(self.y).sum())

    @cached_property
    def report(self) -> RecordReport:
        """Tests and findings of the record, for no particular order; made once.

        Inputs may act within the same sample.
        """
        return self.report_for()

    def report_for(self, *, direct: bool = True, order: int | None = None) -> RecordReport:
        """Report for a model of an order (None: unknown), with or without a direct term."""
        inputs = self.inputs or tuple(f"u{k + 1}" for k in range(self.u.shape[1]))
        outputs = self.outputs or tuple(f"y{k + 1}" for k in range(self.y.shape[1]))
        record = RecordData(
            self.u, self.y, self.excitation, self.starts, self.dt,
            inputs, outputs, direct, order, self.times,
        )  # fmt: skip
        return reported(record).assuming(self.assumed)

    def driven_by(self, excitation: Any, *, samples: SamplesAlong | None = None) -> Experiments:
        """The record with the external signal that drove the loop, as long as u and y.

        Raises `InputError` for an excitation of another length, with gaps, or that never changes.
        """
        pieces = [y for _, y in self.pieces()]
        y = pieces if isinstance(excitation, list) and _holds_arrays(excitation) else self.y
        try:
            driven = as_experiments(excitation, y, dt=self.dt, samples=samples)
        except InputError as error:
            raise InputError(f"excitation, in the place of u: {error}") from None
        if still := driven.still_inputs():
            raise InputError(
                f"excitation: channel {still[0]} never changes: give what was added from outside"
            )
        if len(driven) != len(self):
            raise InputError(
                f"excitation: {len(driven)} samples go with {len(self)} of u and y; cut the "
                "record to a stretch without gaps"
            )
        return replace(self, excitation=driven.u)

    def pieces(self) -> Iterator[tuple[RealArray, RealArray]]:
        """Inputs and outputs of each experiment."""
        for first, end in zip(self.starts, (*self.starts[1:], len(self.u)), strict=True):
            yield self.u[first:end], self.y[first:end]

    def part(self, first: int, end: int) -> Experiments:
        """The samples from ``first`` to before ``end``; experiments are cut there."""
        inside = tuple(start - first for start in self.starts if first < start < end)
        driven = None if self.excitation is None else self.excitation[first:end]
        return replace(
            self,
            u=self.u[first:end],
            y=self.y[first:end],
            starts=(0, *inside),
            excitation=driven,
            times=None if self.times is None else self.times[first:end],
        )

    def delayed(self, delays_samples: Sequence[int]) -> Experiments:
        """The experiments with each input delayed by `delays_samples` [samples].

        The first samples, which depend on inputs before the experiment, are left out, and so is the
        excitation.
        """
        longest = max(delays_samples, default=0)
        if longest == 0:
            return self
        parts = [
            (
                np.column_stack(
                    [u[longest - d : len(u) - d, j] for j, d in enumerate(delays_samples)]
                ),
                y,
            )
            for u, y in self.pieces()
            if len(u) > longest
        ]
        if not parts:
            raise InputError(
                f"a delay of {longest} samples leaves nothing of experiments of at most "
                f"{max(len(u) for u, _ in self.pieces())} samples; give a shorter delay"
            )
        starts = np.cumsum([0, *(len(u) for u, _ in parts)])[:-1]
        return replace(
            self,
            u=np.vstack([u for u, _ in parts]),
            y=np.vstack([y[longest:] for _, y in parts]),
            starts=tuple(int(start) for start in starts),
            excitation=None,
            times=None,
        )

    def from_rest(self, samples: int) -> Experiments:
        """The experiments, each preceded by samples at rest: zero inputs, y as at its first sample.

        If the inputs never move, only the step from rest at the first sample shows their effect.
        """
        us, ys = [], []
        for u, y in self.pieces():
            level = np.array([column[np.isfinite(column)][:1].sum() for column in y.T])
            us.append(np.vstack([np.zeros((samples, u.shape[1])), u]))
            ys.append(np.vstack([np.tile(level, (samples, 1)), y]))
        starts = np.cumsum([0, *(len(u) for u in us)])[:-1]
        rows = tuple(int(start) for start in starts)
        return replace(self, u=np.vstack(us), y=np.vstack(ys), starts=rows, times=None)

    def still_inputs(self) -> list[int]:
        """Mask of the inputs that never change within any experiment."""
        moved = np.zeros(self.u.shape[1], dtype=bool)
        for u, _ in self.pieces():
            moved |= np.ptp(u, axis=0) > 0
        return [int(j) for j in np.flatnonzero(~moved)]


def as_experiments(
    u: Any,
    y: Any = None,
    *,
    dt: float | None = None,
    samples: SamplesAlong | None = None,
    assume: str | Sequence[str] = (),
) -> Experiments:
    """Experiments from arrays, labelled arrays, tables, or lists of them.

    Parameters
    ----------
    u, y
        Inputs and outputs: arrays (N,), (N, channels) or (channels, N), DataArrays with a dimension
        "time", pandas tables whose columns are channels; or lists with one of these for each
        experiment. A Dataset with variables u and y, as `read_record` returns it, or a list of
        such, is given as u alone.
    dt
        Sampling time [s]. None: that of the labels, or 1.
    samples
        Axis of the samples in plain arrays: "rows" for (N, channels) or "columns" for (channels,
        N). None: the axis whose length u and y share.
    assume
        Assumptions that you vouch for although the `report` rejects them, such as "open loop".

    Raises
    ------
    InputError
        The data are not a record, or are faulty: the message names the channel and the sample.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import as_experiments
    >>> record = as_experiments([np.ones(5), np.ones(3)], [np.arange(5.0), np.arange(3.0)])
    >>> record.u.shape, record.starts
    ((8, 1), (0, 5))
    """
    if samples not in (None, "rows", "columns"):
        raise InputError(f'samples is {samples!r}; it must be "rows", "columns" or None')
    if dt is not None:
        need_positive(dt, "dt")
    pairs = _pairs(u, y)
    signals = [as_signals(*pair, samples, number) for number, pair in enumerate(pairs)]
    first = signals[0]
    for number, other in enumerate(signals[1:], 1):
        _refuse_other_channels(first, other, number)
    known = {s.sample_time for s in signals if s.sample_time is not None}
    if dt is None and len({round(np.log(step), 6) for step in known}) > 1:
        raise InputError(
            f"the experiments are sampled every {sorted(known)} s; resample them to one time"
        )
    cut = [(one, part) for one in signals for part in _known_inputs(one.u)]
    if not cut:
        raise InputError("no sample has all inputs; fill the gaps of u or leave a channel out")
    starts = np.cumsum([0, *(part.stop - part.start for _, part in cut)])[:-1]
    times = [one.times[part] for one, part in cut if one.times is not None]
    found = Experiments(
        np.vstack([one.u[part] for one, part in cut]),
        np.vstack([one.y[part] for one, part in cut]),
        starts=tuple(int(start) for start in starts),
        dt=float(dt or next(iter(known), 1.0)),
        inputs=first.inputs,
        outputs=first.outputs,
        input_units=first.input_units,
        output_units=first.output_units,
        assumed=as_names(assume),
        times=np.concatenate(times) if len(times) == len(cut) else None,
    )
    _refuse_dead_inputs(found)
    _refuse_dead_outputs(found)
    return found


def _pairs(u: Any, y: Any) -> list[tuple[Any, Any]]:
    """Inputs and outputs of each experiment, in their original form."""
    if isinstance(u, Experiments):
        raise InputError("the experiments are already one object; give its u and y")
    several = [isinstance(each, list | tuple) and _holds_arrays(each) for each in (u, y)]
    if y is None and several[0]:
        if not len(u):
            raise InputError("u is an empty list; give a Dataset for each experiment")
        return [(each, None) for each in u]
    if several[0] != several[1]:
        raise InputError(
            "one of u and y is a list of experiments and the other is not; give both as lists"
        )
    if not several[0]:
        return [(u, y)]
    if len(u) != len(y) or not len(u):
        raise InputError(f"u has {len(u)} experiments and y {len(y)}; give one u for each y")
    return list(zip(u, y, strict=True))


def _holds_arrays(values: Any) -> bool:
    """Whether a list holds experiments, rather than numbers or rows of numbers."""
    return len(values) == 0 or any(
        hasattr(each, "data_vars") or (hasattr(each, "shape") and np.ndim(each)) for each in values
    )


def _refuse_other_channels(first: Signals, other: Signals, number: int) -> None:
    for name, one, two in (("u", first.u, other.u), ("y", first.y, other.y)):
        if one.shape[1] != two.shape[1]:
            raise InputError(
                f"{name} of experiment {number} has {two.shape[1]} channels and that of "
                f"experiment 0 has {one.shape[1]}; give the same channels in the same order"
            )
    for kind, names, others in (
        ("inputs", first.inputs, other.inputs), ("outputs", first.outputs, other.outputs),
    ):  # fmt: skip
        if names != others:
            raise InputError(
                f"{kind} of experiment {number} are {', '.join(others)} and those of experiment 0 "
                f"{', '.join(names)}; give the same channels in the same order"
            )


def _known_inputs(u: RealArray) -> list[slice]:
    """Stretches of an experiment in which all inputs are known."""
    known = np.isfinite(u).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _refuse_dead_inputs(found: Experiments) -> None:
    """Raise `InputError` for an input without information: always zero, or constant beside others.

    If no input moves at all, each stands for a step at the first sample.
    """
    still = found.still_inputs()
    for j in still:
        if len(still) < found.u.shape[1] or not found.u[:, j].any():
            raise InputError(
                f"u: channel {j} ({found.inputs[j]}) never changes: check its cable and range, or "
                "leave it out"
            )


def _refuse_dead_outputs(found: Experiments) -> None:
    """Raise `InputError` for an output that never changes, or is mostly missing."""
    for i, (name, column) in enumerate(zip(found.outputs, found.y.T, strict=True)):
        measured = column[np.isfinite(column)]
        if len(measured) < (1 - MISSING_SHARE) * len(column):
            raise InputError(
                f"y: {len(column) - len(measured)} of {len(column)} samples of channel {i} "
                f"({name}) are missing; at most half may be: leave the channel out"
            )
        if np.ptp(measured) == 0:
            raise InputError(
                f"y: channel {i} ({name}) never changes: check its cable and range, or leave it out"
            )
