"""Generate a study of plants of several inputs and outputs: from the records to the C file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bench.problem import import_file
from workbench.errors import InputError, SolverError
from workbench.solution import solve
from workbench.starter.channel_records import ChannelRecords
from workbench.starter.first_choices import EFFORT, FirstChoices, first_choices
from workbench.starter.kept_weights import (
    STEP,
    TRIES,
    bandwidth_reason,
    halved_gap,
)
from workbench.starter.request import Request, with_given
from workbench.starter.study_files import TEMPLATES, write_files
from workbench.starter.study_folder import usable_responses
from workbench.synthesis import MuSynthesis
from workbench.synthesis.demands.channels import sized_response
from workbench.synthesis.mu.program import PEAK_TOLERANCE

CHANNEL_TEMPLATES = TEMPLATES | {
    "README.md": "channels_README.md.jinja",
    "problems/{package}/design.py": "channels_design.py.jinja",
    "tests/test_{package}.py": "channels_test.py.jinja",
    "notebooks/{package}.ipynb": "channels_notebook.py.jinja",
}
"""Files of a study of several channels, and the template of each file."""
KEPT = 1 - PEAK_TOLERANCE
"""Certified peak of mu below which a bandwidth is taken. The controller is truncated already, so no
room is needed for that; the study finds the same peak again to within the tolerance of its proof.
"""
GRID = 50
"""Number of frequencies below the bandwidth at which the gains are compared."""


@dataclass(frozen=True)
class ChannelChoices:
    """Numbers of a first design of a plant with several channels, each with its reason.

    ``bandwidth_hz`` [Hz]: bandwidth of every output. ``effort``: weight of the inputs, relative to
    their sizes. ``channels``: the choices for the cover of each channel, by its name such as
    "1-2" for output 1 and input 2. ``sizes``: of inputs and outputs, which count as equally large.
    ``peak``: certified peak of mu, below 1 if the weights are met; ``states``: of the controller;
    NaN and 0 before one was tried. ``columns``, ``notes``, ``tested``: as in `FirstChoices`.

    Examples
    --------
    >>> from workbench.starter import ChannelChoices
    >>> ChannelChoices(0.5, 0.1, {}, ((50.0,), (2.0,)), {}).states
    0
    """

    bandwidth_hz: float
    effort: float
    channels: dict[str, FirstChoices]
    sizes: tuple[tuple[float, ...], tuple[float, ...]]
    reasons: dict[str, str]
    columns: str = field(default="", kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    tested: tuple[str, ...] = field(default=(), kw_only=True)
    peak: float = field(default=np.nan, kw_only=True)
    states: int = field(default=0, kw_only=True)


def write_channel_study(
    folder: str | Path,
    data: str | Sequence[str],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    time: str | None = None,
    record_dt: float | None = None,
    dt: float | None = None,
    delay_samples: float = 1.0,
    bandwidth_hz: float | None = None,
    limits: Sequence[tuple[float, float]] | None = None,
    effort: float | None = None,
    overshoot: float | None = None,
    settling_time: float | None = None,
) -> ChannelChoices:
    """Write the folder of a study of plants with several inputs or outputs.

    Each record belongs to one plant and moves one input; the other inputs rest. Each channel gets a
    cover of its own, and all channels one controller with integral action. A first design is tried
    as in `write_study`.

    Parameters
    ----------
    folder, data, time
        As in `write_study`. The plants must be stable.
    record_dt, dt
        Sampling times [s] of records without a time column, and of the controller's computer; None:
        that of the records.
    delay_samples
        Delay [samples] of the controller's computer.
    bandwidth_hz
        Bandwidth of every output that is asked for [Hz]; None: the largest tried bandwidth that
        meets the weights.
    inputs, outputs
        Names of columns.
    limits
        Least and largest value of each input, absolute; None: those in the records.
    effort
        Weight of the inputs relative to their sizes, which are half the ranges of their limits.
    overshoot
        Overshoot of every output after a step of its set-point, relative to the step.
    settling_time
        Time [s] after which such a step has settled to 2 %.

    Raises
    ------
    InputError
        There are more outputs than inputs; a record moves no input or several; the plants are
        unstable; or as in `write_study`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.starter import write_channel_study
    >>> rng, time = np.random.default_rng(0), np.arange(2000) * 0.01
    >>> for k in (1, 2, 3):
    ...     lag = control.tf([8 + k], [1, 9])
    ...     plant = control.append(lag, lag)
    ...     for j in (0, 1):
    ...         u = np.zeros((2, 2000))
    ...         u[j] = np.tile(rng.standard_normal(250), 8)
    ...         y = control.forced_response(plant, time, u).outputs + 0.2 * u[::-1]
    ...         table, names = np.c_[time, u.T, y.T], "time,u,v,y,z"
    ...         np.savetxt(f"plant{k}-{j}.csv", table, delimiter=",", header=names, comments="")
    ...
    >>> choices = write_channel_study(
    ...     "pair", "plant*.csv", inputs=["u", "v"], outputs=["y", "z"], bandwidth_hz=0.2
    ... )
    >>> sorted(choices.channels), choices.peak < 1
    (['1-1', '1-2', '2-1', '2-2'], True)
    """
    demands = {"overshoot": overshoot, "settling_time": settling_time}
    request = Request.checked(
        folder,
        data,
        demands,
        record_dt=record_dt,
        dt=dt,
        delay_samples=delay_samples,
        limits=limits,
        bandwidth_hz=bandwidth_hz,
        effort=effort,
    )
    records = ChannelRecords.read(request.paths, inputs, outputs, time, record_dt)
    held = records.limits(limits)
    told = request.words(records.period, records.point, held) | {
        "groups": {
            name: [one.name for one in group]
            for name, group in zip(records.u_names, records.files.values(), strict=True)
        },
        "outputs": records.y_names,
        "time": records.time,
        "demands": demands,
    }
    sizes = tuple((0.5 * (held[1] - held[0])).tolist()), (1.0,) * len(records.outputs)
    chosen = _first_choices(records, record_dt, told["period"], delay_samples, sizes)
    chosen = with_given(chosen, {"bandwidth_hz": bandwidth_hz, "effort": effort})
    return write_files(
        request.target,
        request.paths,
        told,
        chosen,
        lambda design: _kept(design, chosen, search=bandwidth_hz is None, given_effort=effort),
        CHANNEL_TEMPLATES,
    )


def _first_choices(
    records: ChannelRecords,
    record_dt: float | None,
    period: float,
    delay_samples: float,
    sizes: tuple[tuple[float, ...], tuple[float, ...]],
) -> ChannelChoices:
    """The choices of every channel, and the bandwidth of the slowest one.

    The effort is 1 until the covers are known. Raises InputError for an unstable channel.
    """
    channels, notes, tested = {}, dict[str, None](), dict[str, None]()
    for name, u, y in records.channels():
        responses, said = usable_responses(
            records.files[u], records.columns[u, y], records.looks[u, y], record_dt, None, (), {}
        )
        channels[name] = first_choices(responses, period, delay_samples=delay_samples)
        if channels[name].unstable_poles:
            raise InputError(
                f"the channel from {u!r} to {y!r} is unstable; several channels are designed "
                "for stable plants only"
            )
        notes |= dict.fromkeys(f"{u} to {y}: {one}" for one in said)
        tested |= dict.fromkeys(responses.tested)
    slowest = min(channels.values(), key=lambda one: one.bandwidth_hz)
    return ChannelChoices(
        slowest.bandwidth_hz,
        1.0,
        channels,
        sizes,
        {
            "bandwidth_hz": slowest.reasons["bandwidth_hz"],
            "effort": f"{EFFORT:g} times the least gain of the plants below the bandwidth, in the "
            "direction in which it is smallest",
        },
        columns="; ".join(dict.fromkeys(look.columns for look in records.looks.values())),
        notes=tuple(notes),
        tested=tuple(tested),
    )


def _kept(
    design: Path, chosen: ChannelChoices, *, search: bool, given_effort: float | None
) -> ChannelChoices:
    """The choices with the largest tried bandwidth whose certified peak of mu is below 1."""
    study = import_file(design.parents[1], design)
    models = study.rows_of({name: _model(study, name) for name in chosen.channels})
    lowest = 2 * math.pi * max(one.band_hz[0] for one in chosen.channels.values())
    u_sizes = chosen.sizes[0]
    static = np.abs(sized_response(models, np.array([lowest]), (u_sizes, chosen.sizes[1]))[0])
    sizes = u_sizes, tuple(float(f"{one:.4g}") for one in static.max(axis=1))

    def tried(bandwidth: float) -> ChannelChoices:
        bandwidth = float(f"{bandwidth:.3g}")
        omega = np.geomspace(lowest, max(2 * math.pi * bandwidth, 1.01 * lowest), GRID)
        gains = np.linalg.svd(sized_response(models, omega, sizes), compute_uv=False)
        effort = given_effort or float(f"{EFFORT * gains[:, -1].min():.3g}")
        plant = study.weighted(models, bandwidth, effort, sizes)
        # Without a target the synthesis settles, and its controller is truncated.
        found = solve(MuSynthesis(plant, integral=True), method="dk").answer
        return replace(
            chosen,
            bandwidth_hz=bandwidth,
            effort=effort,
            sizes=sizes,
            peak=math.inf if found is None else float(found.upper),
            states=0 if found is None else int(found.K.nstates),
        )

    every = [tried(chosen.bandwidth_hz)]
    while search and every[-1].peak >= KEPT and len(every) < TRIES:
        every.append(tried(every[-1].bandwidth_hz / STEP))
    best = min(every, key=lambda one: one.peak)
    if search and best.peak < KEPT and len(every) > 1:
        best, more = halved_gap(best, every[-2].bandwidth_hz, tried, KEPT)
        every += more
        best.reasons["bandwidth_hz"] = bandwidth_reason(every, best, every[0])
    return best


def _model(study: Any, channel: str) -> Any:
    """The model of a certified cover of a channel."""
    covered = solve(study.cover(channel))
    if covered.certificate is None or not covered.certificate.valid:
        raise SolverError(f"channel {channel} has no certified cover: {covered.message}")
    return covered.answer.model
