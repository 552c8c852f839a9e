"""Bode, Nyquist, step and pole figures of random members, with what is proven for all members."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_list, need_count
from workbench.mu.robust.margin import robust_stability
from workbench.mu.robust.worst_case import worst_case_gain
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import pole_sizes, worst_pole
from workbench.uncertainty.algebra.bundles import largest_gains
from workbench.uncertainty.algebra.system import MOST_MEMBERS, UncertainSystem, uncertain

Kind = Literal["bode", "nyquist", "step", "poles"]
"""Kinds of panels."""
POINTS = 300
"""Number of points on a curve. Corners are not seen at the size of a page. Half shows them in an
enlarged figure; double makes files larger.
"""
SETTLING = 8.0
"""Duration of a drawn step response, in time constants of the slowest nominal pole. The response
has settled to exp(-8), 0.03 %. Half cuts slow tails off; double shows fast ones smaller.
"""
BOUND_TOLERANCE, MARGIN_TOLERANCE = 1e-2, 1e-3
"""Tolerances of the worst-case gain and of the stability margin. They are told beside curves. Half
or double changes a third or fourth digit.
"""
FAR = 10.0
"""Largest ratio of sizes of poles that are drawn on a linear scale. Beyond it the near poles would
fall on one point. Half or double changes the scale of some figures.
"""
GREY: dict[str, Any] = {"color": "0.65", "linewidth": 0.6}
"""Style of members."""


def bundle_plot(
    system: Any, *, kinds: Sequence[Kind] = get_args(Kind), samples: int = 40, seed: int = 0
) -> Figure:
    """Panels of the nominal and of random members of an uncertain system, with proven bounds.

    The Bode panel shows the proven worst-case gain, and the panel of poles the proven margin of
    robust stability, both only if the nominal system is stable.

    Parameters
    ----------
    system
        An `UncertainSystem`, or an object that stands for one. With several channels the Bode panel
        shows the largest singular value, and the others the first channel.
    kinds
        Any of "bode", "nyquist", "step", "poles".

    Raises
    ------
    InputError
        The system has no uncertain element, or a kind is not known.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import bundle_plot
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> len(bundle_plot(closed, kinds=["step", "poles"], samples=5).axes)
    2
    """
    found = uncertain(system, "system")
    if not found.elements:
        raise InputError("the system has no uncertain element; all its members are the same")
    wanted = [kinds] if isinstance(kinds, str) else as_list(kinds, "kinds")
    if not wanted or any(
        not isinstance(kind, str) or kind not in get_args(Kind) for kind in wanted
    ):
        raise InputError(f"kinds are {kinds!r}; any of {get_args(Kind)} are needed")
    need_count("samples", samples, MOST_MEMBERS)
    members = found.sample(samples, seed=seed)
    columns = 1 if len(wanted) == 1 else 2
    rows = math.ceil(len(wanted) / columns)
    figure, panels = figures.axes(rows, columns, size=(3.8 * columns + 0.4, 3.2 * rows + 0.6))
    for kind, panel in zip(wanted, panels, strict=False):
        _PANELS[kind](panel, found, members)
    for panel in panels[len(wanted) :]:
        panel.set_visible(False)
    panels[0].plot([], [], **GREY, label=f"{samples} random members")
    panels[0].plot([], [], color=figures.BLUE, label="nominal")
    figures.legend_below(figure, panels[0])
    return figure


def _bode(panel: Any, system: UncertainSystem, members: Sequence[StateSpace]) -> None:
    omega = _frequencies(system.nominal)
    hertz = omega / (2 * np.pi)
    for member in members:
        panel.plot(hertz, largest_gains(member, omega), **GREY)
    panel.plot(hertz, largest_gains(system.nominal, omega), color=figures.BLUE)
    if worst_pole(system.nominal)[1] < 0:
        bound = worst_case_gain(system, tolerance=BOUND_TOLERANCE).upper
        if math.isfinite(bound):
            words = f"proven for all: at most {bound:.3g}"
            panel.axhline(bound, color=figures.BLACK, linestyle="--", label=words)
    figures.label(panel, x="frequency [Hz]", y="gain [1]", log="xy")


def _nyquist(panel: Any, system: UncertainSystem, members: Sequence[StateSpace]) -> None:
    omega = _frequencies(system.nominal)
    far = []
    for member in members:
        value = response(member, omega)[:, 0, 0]
        panel.plot(value.real, value.imag, **GREY)
        far.append(float(np.abs(value).max()))
    value = response(system.nominal, omega)[:, 0, 0]
    panel.plot(value.real, value.imag, color=figures.BLUE)
    panel.plot([-1.0], [0.0], "+", color=figures.BLACK)
    # Members near instability do not set the scale.
    end = max(1.2, 1.1 * float(np.quantile(far, 0.9)), 1.1 * float(np.abs(value).max()))
    panel.set_xlim(-end, end)
    panel.set_ylim(-end, end)
    figures.label(panel, x="real part [1]", y="imaginary part [1]")


def _step(panel: Any, system: UncertainSystem, members: Sequence[StateSpace]) -> None:
    import control

    nominal = system.nominal
    poles = nominal.poles()
    if nominal.dt:
        poles = np.log(poles[np.abs(poles) > 0].astype(complex)) / nominal.dt
    slow = np.abs(poles.real)
    slow = slow[slow > 1e-9 * np.abs(poles).max(initial=0.0)]
    end = SETTLING / float(slow.min()) if slow.size else 1.0
    time = np.linspace(0.0, end, POINTS)
    if nominal.dt:
        time = nominal.dt * np.arange(max(int(end / nominal.dt), 2))
    for k, one in enumerate([*members, nominal]):
        found = control.step_response(one[0, 0], time)
        style: dict[str, Any] = GREY if k < len(members) else {"color": figures.BLUE}
        panel.plot(found.time, np.ravel(found.outputs), **style)
    figures.label(panel, x="time [s]", y="output after a unit step [1]")


def _poles(panel: Any, system: UncertainSystem, members: Sequence[StateSpace]) -> None:
    nominal = system.nominal.poles()
    every = np.concatenate([one.poles() for one in members])
    if system.dt:
        turn = np.exp(1j * np.linspace(0, 2 * np.pi, POINTS))
        panel.plot(turn.real, turn.imag, color=figures.BLACK, linewidth=0.8)
    else:
        panel.axvline(0.0, color=figures.BLACK, linewidth=0.8)
        # Poles far beyond the nominal ones, such as those of short delays, do not set the scale.
        every = every[np.abs(every) <= FAR * np.abs(nominal).max(initial=1.0)]
        sizes = np.abs(nominal.real)[np.abs(nominal.real) > 0]
        if sizes.size and sizes.max() > FAR * sizes.min():
            panel.set_xscale("symlog", linthresh=float(sizes.min()))
            panel.xaxis.get_major_locator().set_params(numticks=5)
    panel.plot(every.real, every.imag, ".", color="0.65", markersize=2.5)
    panel.plot(nominal.real, nominal.imag, "x", color=figures.BLUE)
    unit = "1" if system.dt else "rad/s"
    title = "nominal unstable"
    if worst_pole(system.nominal)[1] < 0:
        margin = robust_stability(system, tolerance=MARGIN_TOLERANCE)
        title = f"proven stable to {margin.lower:.3g} x size"
    figures.label(panel, x=f"real part [{unit}]", y=f"imaginary part [{unit}]", title=title)


_PANELS: dict[str, Callable[[Any, UncertainSystem, Sequence[StateSpace]], None]] = {
    "bode": _bode,
    "nyquist": _nyquist,
    "step": _step,
    "poles": _poles,
}


def _frequencies(nominal: StateSpace) -> RealArray:
    sizes = pole_sizes(nominal)
    sizes = sizes[sizes > 0]
    low, high = (sizes.min() / 30, sizes.max() * 30) if sizes.size else (1e-2, 1e2)
    if nominal.dt:
        high = math.pi / nominal.dt
    omega = frequencies_of(nominal) if not nominal.dt else np.empty(0)
    near = omega[(omega >= low) & (omega <= high)]
    found: RealArray = np.union1d(near, np.geomspace(min(low, high / 10), high, POINTS))
    return found
