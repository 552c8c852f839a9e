"""Figures of a loop with many plants of its set: gains of the performance, and step responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import expm

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Axes, Figure, StateSpace
from workbench.structure import Structure
from workbench.synthesis.h_infinity.figures import grid
from workbench.synthesis.h_infinity.singular_plants.regularised import ADDED
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.joints import UncertainPart
from workbench.systems.realisation import worst_pole
from workbench.systems.sampling import respond, sampled_model
from workbench.uncertainty.algebra.system import uncertain

MEMBERS = 20
"""Number of random plants of the set in a figure."""
MOST_PANELS = 3
"""Largest number of signals in a column of panels, and of inputs in a row."""
POINTS = 400
"""Number of instants of a step response."""
LONGEST_IN_MS = 0.1
"""Durations [s] below this are shown in milliseconds."""
AT_REST = 0.05
"""A step response has ended within this distance from the final value, relative to the
largest one.
"""


@dataclass(frozen=True, eq=False)
class _Loop(UncertainPart):
    """A closed loop with the perturbation channels open."""

    closed: StateSpace
    blocks: Structure

    @property
    def structure(self) -> Structure:
        blocks: list[Any] = list(self.blocks)  # their names may be arbitrary and not unique
        return Structure(replace(one, name=f"delta_{k}") for k, one in enumerate(blocks, start=1))

    @property
    def system(self) -> StateSpace:
        return self.closed

    @property
    def lti(self) -> StateSpace:
        return uncertain(self).nominal


@dataclass(frozen=True, eq=False)
class DrawnLoops:
    """The nominal loop and random ones, from exogenous inputs to performance, y and u.

    Unlike a closed `StateSpace`, it holds random members of a set beside the nominal, for
    figures.

    ``performance`` is the number of performance outputs, which come first; the measurements and the
    controls follow. ``units`` are the known units of signals, by name.
    """

    nominal: StateSpace
    random: Sequence[StateSpace]
    performance: int
    inputs: Sequence[str]
    outputs: Sequence[str]
    units: Mapping[str, str]


def drawn_loops(
    plant: GeneralisedPlant, K: StateSpace, units: Mapping[str, str] | None = None
) -> DrawnLoops:
    """The loop of the nominal plant, and of random plants of the set if there is a set."""
    import control

    given, y, u = plant.system, plant.measurements, plant.controls
    unit = np.eye(u, given.ninputs, given.ninputs - u)
    # Measurements and controls become outputs beside the performance.
    C = np.vstack([given.C, np.zeros((u, given.nstates)), given.C[-y:]])
    D = np.vstack([given.D, unit, given.D[-y:]])
    told = GeneralisedPlant(
        control.StateSpace(given.A, given.B, C, D, given.dt, remove_useless_states=False),
        plant.structure,
        u,
        y,
    )
    loop = told.close(K)
    columns, rows = (plant.structure.rows, plant.structure.columns) if plant.structure else (0, 0)
    inputs = given.input_labels[columns : given.ninputs - u]
    outputs = [*given.output_labels[rows:], *given.input_labels[-u:]]
    if plant.structure is None:
        return DrawnLoops(loop, (), plant.performance, inputs, outputs, units or {})
    found = uncertain(_Loop(loop, plant.structure))
    random = found.sample(MEMBERS)
    return DrawnLoops(found.nominal, random, plant.performance, inputs, outputs, units or {})


def performance_figure(loops: DrawnLoops, peak: float) -> Figure:
    """Gain from all exogenous inputs to each performance output; the demand is 1.

    `peak` is an upper bound on mu of robust performance. If it is at most 1, it also bounds the
    gain for every plant of the set. If it is larger, it bounds the gain only for smaller
    deviations.
    """
    count = loops.performance if loops.performance <= MOST_PANELS else 1
    omega = grid(loops.nominal)
    figure, panels = figures.axes(count, 1, size=(7.0, 1.2 + 2.4 * count), sharex=True)
    parts = [[k] for k in range(count)] if count > 1 else [list(range(loops.performance))]
    for panel, part in zip(panels, parts, strict=True):
        for one in [*loops.random, loops.nominal]:
            gains = np.linalg.norm(response(one, omega)[:, part, :], 2, axis=(1, 2))
            _line(panel, one is loops.nominal, omega / (2 * np.pi), np.maximum(gains, 1e-300))
        panel.axhline(1.0, color=figures.BLACK, linestyle="--", label="asked for: below 1")
        if peak <= 1.0:
            words = f"certified for all plants: {peak:.3g}"
            panel.axhline(peak, color=figures.ORANGE, linestyle=":", label=words)
        name = loops.outputs[part[0]] if len(part) == 1 else "all outputs"
        figures.label(panel, y=f"gain to {name} [1]", log="xy")
        low, high = panel.get_ylim()
        panel.set_ylim(max(low, 1e-4 * high), high)
    panels[-1].set_xlabel("frequency [Hz]")
    _legend(figure, panels[0], loops, len(loops.random))
    return figure


def steps_figure(loops: DrawnLoops) -> Figure:
    """Measurements and controls after a unit step of each exogenous input.

    Inputs that `regularise` added are not signals of the loop. They are left out if there are
    others.
    """
    first = loops.performance
    shown = range(first, len(loops.outputs))[:MOST_PANELS]
    own = [k for k, name in enumerate(loops.inputs) if not name.startswith(ADDED)]
    steps = (own or list(range(len(loops.inputs))))[:MOST_PANELS]
    stable = [one for one in loops.random if worst_pole(one)[1] < 0]
    size = (max(7.0, 3.6 * len(steps)), 1.2 + 2.2 * len(shown))
    figure, panels = figures.axes(len(shown), len(steps), size=size, sharex="col")
    for column, step in enumerate(steps):
        part = [one[first:, step] for one in (*stable, loops.nominal)]
        time = _instants(part[-1])
        scale, second = (1e3, "ms") if time[-1] < LONGEST_IN_MS else (1.0, "s")
        for one in part:
            values = _step(one, time)
            for row, signal in enumerate(shown):
                panel = panels[row * len(steps) + column]
                _line(panel, one is part[-1], scale * time, values[:, signal - first])
                figures.label(panel, y=_with_unit(loops, loops.outputs[signal], column))
        name = loops.inputs[step]
        unit = loops.units.get(name, "1")
        words = "unit step of" if unit == "1" else f"step of 1 {unit} in"
        figures.label(panels[column], title=f"{words} {name}")
        panels[(len(shown) - 1) * len(steps) + column].set_xlabel(f"time [{second}]")
    _legend(figure, panels[0], loops, len(stable))
    return figure


def _with_unit(loops: DrawnLoops, name: str, column: int) -> str:
    """Label of a signal's axis in the first column."""
    return "" if column else f"{name} [{loops.units.get(name, 'its own unit')}]"


def _line(panel: Axes, nominal: bool, x: RealArray, y: RealArray) -> None:
    style = {"color": figures.BLUE} if nominal else {"color": "0.65", "linewidth": 0.7}
    panel.plot(x, y, **style)


def _legend(figure: Figure, panel: Axes, loops: DrawnLoops, drawn: int) -> None:
    """The legend below the panels, which also tells how many unstable members are left out."""
    panel.plot([], [], color=figures.BLUE, label="nominal")
    if loops.random:
        missing = len(loops.random) - drawn
        left = f", {missing} unstable ones left out" if missing else ""
        panel.plot([], [], color="0.65", linewidth=0.7, label=f"{drawn} random plants{left}")
    figures.legend_below(figure, panel)


def _instants(system: StateSpace) -> RealArray:
    """Instants (POINTS,) [s] from the step until all outputs are at rest."""
    poles = system.poles().astype(complex)
    if system.dt:
        poles = np.log(poles[np.abs(poles) > 0]) / system.dt
    sizes, rates = np.abs(poles), np.abs(poles.real)
    rates = rates[rates > 1e-9 * sizes.max(initial=0.0)]
    slowest, fastest = (rates.min(), sizes.max()) if rates.size else (1.0, 1.0)
    tried = np.geomspace(0.1 / fastest, 10.0 / slowest, 100)
    if system.dt:
        tried = np.unique(np.maximum(np.round(tried / system.dt), 1)) * system.dt
    values = np.array([_value(system, float(t)) for t in tried])
    largest = np.abs(values).max(axis=0)
    away = (np.abs(values - values[-1]) > AT_REST * np.maximum(largest, 1e-300)).any(axis=1)
    last = int(np.flatnonzero(away)[-1]) if away.any() else 0
    end = 2.0 * tried[min(last + 1, tried.size - 1)]
    if system.dt:
        return system.dt * np.arange(max(int(end / system.dt), 2) + 1)
    return np.linspace(0.0, end, POINTS)


def _value(system: StateSpace, t: float) -> RealArray:
    """Outputs at one instant after a unit step of the only input."""
    n = system.nstates
    M = np.zeros((n + 1, n + 1))
    if system.dt:
        M[:n, :n], M[:n, n:], M[n, n] = system.A, system.B, 1.0
        power = np.linalg.matrix_power(M, round(t / system.dt))
    else:
        M[:n, :n], M[:n, n:] = system.A, system.B
        power = expm(M * t)
    found: RealArray = system.C @ power[:n, n] + system.D[:, 0]
    return found


def _step(system: StateSpace, time: RealArray) -> RealArray:
    """Outputs (POINTS, outputs) at equidistant instants after a unit step of the only input."""
    held = system if system.dt else sampled_model(system, float(time[1]))
    return respond(held, np.ones((time.size, 1)))
