"""Generate a study of plants of several inputs and outputs: from the records to the C file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.bench.problem import import_file
from workbench.errors import InputError, SolverError
from workbench.identification.files.variables import read_table
from workbench.input_checks import as_list, need_positive
from workbench.solution import solve
from workbench.solvers import Options
from workbench.starter.columns import record_columns
from workbench.starter.first_choices import BENT, CONFIDENCE, EFFORT, FirstChoices, first_choices
from workbench.starter.first_look import FirstLook, first_look
from workbench.starter.kept_weights import (
    KEPT,
    STEP,
    TARGET,
    TRIES,
    bandwidth_reason,
    halved_gap,
)
from workbench.starter.study_files import TEMPLATES, write_files
from workbench.starter.study_folder import distinct_files, new_folder, usable_responses
from workbench.synthesis import MuSynthesis, WorkingPoint
from workbench.synthesis.demands.channels import sized_response
from workbench.synthesis.demands.demands import Demands
from workbench.synthesis.implementation.working_point.actuator import actuator

CHANNEL_TEMPLATES = TEMPLATES | {
    "README.md": "channels_README.md.jinja",
    "problems/{package}/design.py": "channels_design.py.jinja",
    "tests/test_{package}.py": "channels_test.py.jinja",
    "notebooks/{package}.ipynb": "channels_notebook.py.jinja",
}
"""Files of a study of several channels, and the template of each file."""
MOVED = 0.05
"""An input that moves by less than this fraction of its largest movement counts as at rest."""
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
    demanded: dict[str, Any] = {"overshoot": overshoot, "settling_time": settling_time}
    Demands(**demanded)  # raises for invalid numbers
    for name, number in (
        {"bandwidth_hz": bandwidth_hz, "effort": effort, "dt": dt, "record_dt": record_dt}
    ).items():
        need_positive(number, name, or_none=True)
    target, paths = new_folder(folder), distinct_files(data)
    inputs, outputs = (as_list(names, "names of columns") for names in (inputs, outputs))
    if len(outputs) > len(inputs):
        raise InputError(
            f"{len(outputs)} outputs cannot follow set-points of their own by {len(inputs)} "
            f"input{'s' if len(inputs) > 1 else ''}: name as many inputs as outputs, or more"
        )
    named = {
        (u, y): record_columns(paths[0], u, y, time, record_dt) for u in inputs for y in outputs
    }
    files = _files_by_input(paths, [named[u, outputs[0]][0] for u in inputs])
    looks = {
        (u, y): first_look(group, *named[u, y], record_dt)
        for u, group in zip(inputs, files.values(), strict=True)
        for y in outputs
    }
    period = looks[inputs[0], outputs[0]].period if dt is None else dt
    point, held = _rest(looks, inputs, outputs), _limits(looks, inputs, outputs, limits)
    actuator(held, None, point, (len(outputs), len(inputs)), period)  # raises for invalid limits
    channels, notes, tested = {}, dict[str, None](), dict[str, None]()
    for j, (u, group) in enumerate(zip(inputs, files.values(), strict=True)):
        for i, y in enumerate(outputs):
            responses, said = usable_responses(
                group, named[u, y], looks[u, y], record_dt, None, (), {}
            )
            channel = first_choices(responses, period, delay_samples=delay_samples)
            if channel.unstable_poles:
                raise InputError(
                    f"the channel from {u!r} to {y!r} is unstable; several channels are designed "
                    "for stable plants only"
                )
            channels[f"{i + 1}-{j + 1}"] = channel
            notes |= dict.fromkeys(f"{u} to {y}: {one}" for one in said)
            tested |= dict.fromkeys(responses.tested)
    slowest = min(channels.values(), key=lambda one: one.bandwidth_hz)
    chosen = ChannelChoices(
        bandwidth_hz or slowest.bandwidth_hz,
        effort or 1.0,  # until the covers are known
        channels,
        (tuple((0.5 * (held[1] - held[0])).tolist()), (1.0,) * len(outputs)),
        {
            "bandwidth_hz": "as given" if bandwidth_hz else slowest.reasons["bandwidth_hz"],
            "effort": "as given"
            if effort
            else f"{EFFORT:g} times the least gain of the plants below the bandwidth, in the "
            "direction in which it is smallest",
        },
        columns="; ".join(dict.fromkeys(look.columns for look in looks.values())),
        notes=tuple(notes),
        tested=tuple(tested),
    )
    u_names = [named[u, outputs[0]][0] for u in inputs]
    told: dict[str, Any] = {
        "plant": target.name,
        "package": target.name.lower().replace("-", "_"),
        "groups": {u: [one.name for one in files[u]] for u in u_names},
        "outputs": [named[inputs[0], y][1] for y in outputs],
        "time": named[inputs[0], outputs[0]][2],
        "record_dt": record_dt,
        "point": point,
        "period": period,
        "delay_samples": delay_samples,
        "limits": tuple(tuple(map(float, side)) for side in held),
        "limits_from": "of the records" if limits is None else "as given",
        "demands": demanded,
        "confidence": CONFIDENCE,
        "bent": BENT,
        "target": TARGET,
    }
    return write_files(
        target,
        paths,
        told,
        chosen,
        lambda design: _kept(design, chosen, search=bandwidth_hz is None, given_effort=effort),
        CHANNEL_TEMPLATES,
    )


def _files_by_input(paths: Sequence[Path], inputs: Sequence[str]) -> dict[str, list[Path]]:
    """The records that move each input. Raises InputError if one moves none or several."""
    moves = np.array(
        [[float(np.ptp(read_table(path).variables[name])) for name in inputs] for path in paths]
    )
    moved = moves > MOVED * moves.max(axis=0)
    for path, row in zip(paths, moved, strict=True):
        if row.sum() != 1:
            names = ", ".join(repr(name) for name, one in zip(inputs, row, strict=True) if one)
            raise InputError(
                f"{path} moves {names or 'no input'}; a record must move one of the inputs "
                f"{', '.join(map(repr, inputs))}, while the others rest"
            )
    found = {
        name: [path for path, row in zip(paths, moved, strict=True) if row[j]]
        for j, name in enumerate(inputs)
    }
    for name, group in found.items():
        if len(group) < 2:
            raise InputError(
                f"{len(group)} record moves {name!r}; two plants or more are needed for every input"
            )
    return found


def _rest(
    looks: dict[tuple[str, str], FirstLook], inputs: Sequence[str], outputs: Sequence[str]
) -> WorkingPoint:
    """The means of all signals in their records."""
    first, last = looks[inputs[0], outputs[0]].point, looks[inputs[-1], outputs[-1]].point
    u = [looks[name, outputs[0]].point.u[0] for name in inputs]
    y = [float(np.mean([looks[u, name].point.y[0] for u in inputs])) for name in outputs]
    units = {
        side: getattr(first, side) if getattr(first, side) == getattr(last, side) else "1"
        for side in ("u_unit", "y_unit")
    }
    return WorkingPoint(u, [float(f"{one:.5g}") for one in y], **units)


def _limits(
    looks: dict[tuple[str, str], FirstLook],
    inputs: Sequence[str],
    outputs: Sequence[str],
    limits: Sequence[tuple[float, float]] | None,
) -> tuple[RealArray, RealArray]:
    """Lowest and highest values of the inputs."""
    pairs = [looks[u, outputs[0]].limits for u in inputs] if limits is None else list(limits)
    if len(pairs) != len(inputs):
        raise InputError(f"{len(pairs)} limits are given for {len(inputs)} inputs: one pair each")
    low, high = np.array(pairs, dtype=float).T
    return low, high


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
        task = MuSynthesis(plant, target=TARGET, integral=True)
        found = solve(task, method="dk", options=Options()).answer
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
        best, more = halved_gap(best, every[-2].bandwidth_hz, tried)
        every += more
        best.reasons["bandwidth_hz"] = bandwidth_reason(every, best, every[0])
    return best


def _model(study: Any, channel: str) -> Any:
    """The model of a certified cover of a channel."""
    covered = solve(study.cover(channel), options=Options())
    if covered.certificate is None or not covered.certificate.valid:
        raise SolverError(f"channel {channel} has no certified cover: {covered.message}")
    return covered.answer.model
