"""Residuals of u and f_en that are zero without a fault, and the sign of equations 7.8 and 7.20.

    r = H_act u + H_photo f_en                        equation 7.7

With f_en = K_optn (ACT u + f_sd), equations 7.6 and 7.15, r is zero without the fault f_sd if H_act
+ H_photo K_optn ACT = 0. This is equation 7.19, while equations 7.8 and 7.20 have a minus. The
minus is right with f_en = K_optn (-x + f_sd), equation 7.30. Equation numbers refer to E. Vidal
Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.certificate import THIS_SYSTEM
from workbench.diagnosis import FaultModel, fault_detection
from workbench.simulation import respond, sampled_model
from workbench.study import Study, array, check, dim, figure, metric, system, table
from workbench.systems import realisation, response
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray, StateSpace

from ..control.control_problem import optical_gain
from ..drive.actuator import transfer_coefficients
from ..drive.disc import VELOCITY
from ..drive.plants import nominal_parameters, plant, responses, total_gain
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values, drives
from ..laboratory.bench_setup import PERIOD
from .defect_runs import ROTATION

PLANTS = {"equation 7.6": 1.0, "equation 7.30": -1.0}
"""Sign with which u moves the error, by the equation that states it."""
GENERATORS = ("model beside", "placed poles")
"""Two generators: H_photo constant and H_act the drive's own model; or poles chosen freely."""
FILTERS = {f"{one}, {said}": (one, said) for said in PLANTS for one in GENERATORS}
"""Residual generators by name: their kind, and the plant for which they are made."""
CONDITIONS = {"plus": 1.0, "minus, as printed": -1.0}
"""Sign of the condition H_act +- H_photo K_optn ACT = 0."""
FREQUENCY = np.geomspace(0.1, 15e3, 121)
"""Frequencies [Hz], many more than the degree of a residual's numerator."""
LEAK = 1e-9
"""Largest gain from the control to a residual that should be zero, over that of H_act alone."""
DOUBLED = 1.9
"""Least such gain with the wrong sign, where both terms add up: 2 without rounding."""
DURATION, STRIDE = 0.2, 5
"""Duration shown [s], and distance of its points [samples]."""
SCRATCH = 0.13, 1.2e-3, 5e-6
"""Start [s], length along the track [m] and false displacement [m] of the fault in the figure."""


@problem("cd/{axis}/exact-residuals", axis=("focus", "radial"), data=TABLES, added=("values",))
def exact_residuals(
    axis: Axis,
    pole_hz: Annotated[float, Field(gt=0, le=1e5)] = 1000.0,
    values: Values = "printed",
) -> ExactResiduals:
    """Residuals of the drive that are zero without a fault (eq. 7.6 to 7.8, figure 7.3).

    H_act and H_photo of least order are computed for the nominal drive, for f_en = K_optn (ACT u +
    f_sd) and for f_en = K_optn (-x + f_sd), each with the sign of equation 7.8 that makes the
    residual zero and with the other sign. The part of u that remains in the residual is computed
    for each of twelve drives, too.

    pole_hz: pole of the second generator [Hz]; the first one has the drive's own poles. values: of
    the drives, "printed" or "corrected".
    """
    return ExactResiduals(axis, pole_hz, values)


@dataclass(frozen=True)
class ExactResiduals(Study):
    """Two generators for two signs of the plant, each with both signs of the condition."""

    axis: Axis
    pole_hz: float
    values: Values

    headline: ClassVar[str] = "leak_plus_equation_7_6"

    @property
    def quantifier(self) -> str:
        return f"at {len(FREQUENCY)} frequencies, more than the degree of what is to be zero"

    def model(self, sign: float) -> FaultModel:
        """u [V], f_sd [m] -> f_en [units], without the anti-aliasing filter, as in eq. 7.6."""
        G = plant(nominal_parameters(self.axis), total_gain(self.axis), antialiasing=False)
        D = np.array([[0.0, optical_gain(self.axis)]])
        matrices = G.A, np.hstack([sign * G.B, 0.0 * G.B]), G.C, D
        system = realisation(matrices, 0.0, inputs=["u", "f_sd"], outputs=["f_en"])
        return FaultModel(system, controls=("u",), faults=("f_sd",))

    filter, condition = dim(FILTERS), dim(CONDITIONS)
    frequency = dim(FREQUENCY, unit="Hz")
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    time = dim(lambda: np.arange(0.0, DURATION, PERIOD)[::STRIDE], unit="s")

    @system(filter, called="{}")
    def filters(self) -> dict[str, StateSpace]:
        """Q of r = Q [f_en; u], scaled so that a constant fault of 1 m gives 1."""
        own = sorted(self.model(1.0).system.poles(), key=abs)
        poles: dict[str, Any] = dict(zip(GENERATORS, (own, -2 * np.pi * self.pole_hz), strict=True))
        return {
            name: fault_detection(self.model(PLANTS[said]), poles[kind], omega=0.0).Q
            for name, (kind, said) in FILTERS.items()
        }

    leak = array(
        dims=(filter, condition, frequency),
        unit="1",
        meaning="gain from u to r over that of H_act alone",
    )(lambda self, filters: leaks_of(self.axis, filters))

    @array(dims=(filter, frequency), unit="1/m", meaning="gain from f_sd to r")
    def fault_gain(self, filters: dict[str, StateSpace]) -> Any:
        return [optical_gain(self.axis) * abs(_parts(Q)[0]) for Q in filters.values()]

    @array(
        dims=(drive, frequency),
        unit="1",
        meaning="gain from u to r of another drive, over that of H_act alone",
    )
    def leak_of_drives(self) -> RealArray:
        """With the generator of the nominal drive; the same for every H_photo."""
        every = responses(self.axis, FREQUENCY, values=self.values, antialiasing=False)
        return np.abs(every / nominal_response(self.axis) - 1.0)

    @array(dims=(condition, time), unit="m", meaning="residual of the model beside, equation 7.6")
    def course(self, filters: dict[str, StateSpace]) -> Any:
        """u is 1 V at the rotation frequency; a scratch causes a false displacement."""
        Q, seconds = next(iter(filters.values())), np.arange(0.0, DURATION, PERIOD)
        given = np.column_stack([np.sin(2 * np.pi * ROTATION * seconds), scratch(seconds)])
        found = []
        for sign in CONDITIONS.values():
            turned = realisation((Q.A, Q.B * [1.0, sign], Q.C, Q.D * [1.0, sign]), 0.0)
            found.append(
                respond(sampled_model(_joined(turned, self.model(1.0)), PERIOD), given)[::STRIDE, 0]
            )
        return np.array(found, np.float32)

    fault = array(
        dims=time,
        unit="m",
        meaning="false displacement",
        value=lambda time: scratch(time.values).astype("f4"),
    )

    # --- checks -------------------------------------------------------------------------------

    @check(over=THIS_SYSTEM)
    def stable(self, filters: dict[str, StateSpace]) -> list[Check]:
        what = "real part of its slowest pole [rad/s]"
        slowest = {name: float(Q.poles().real.max()) for name, Q in filters.items()}
        return [Check(f"stable: {name}", what, one, -1.0) for name, one in slowest.items()]

    @check(title="zero without a fault", at_most=LEAK)
    def exact(self, filters: dict[str, StateSpace]) -> float:
        """gain from u to r over that of H_act alone, by the sign that the plant asks for"""
        return float(_by_sign(leaks_of(self.axis, filters), right=True).max())

    @check(title="the other sign", at_most=-DOUBLED)
    def doubled(self, filters: dict[str, StateSpace]) -> float:
        """minus the least gain from u to r over that of H_act alone, by the other sign"""
        return float(-_by_sign(leaks_of(self.axis, filters), right=False).min())

    @check(title="gains", at_most=LEAK)
    def stored_gains(self, filters: dict[str, StateSpace], leak: DataArray) -> DataArray:
        """largest difference of a stored gain from that of the stored generators [1]"""
        return abs(leak - leaks_of(self.axis, filters))

    @check(title="fault", statement="distance of the gain of a constant fault from 1", at_most=1e-6)
    def detected(self, filters: dict[str, StateSpace]) -> float:
        gains = [optical_gain(self.axis) * _parts(Q, np.zeros(1))[0] for Q in filters.values()]
        return float(abs(np.array(gains) - 1.0).max())

    @check(title="residual over time", at_most=1e-6)
    def quiet(self, course: DataArray, fault: DataArray) -> DataArray:
        """largest residual where there is no fault, by the right sign, over the fault's size"""
        clean = course.sel(condition="plus").where(fault == 0.0)
        return abs(clean).max() / fault.max()

    # --- what is told -------------------------------------------------------------------------

    @metric
    def leaks(self, leak: DataArray) -> dict[str, DataArray]:
        """Largest gain with either sign of the condition, by the equation of the plant."""
        found = {}
        for said in PLANTS:
            names = [name for name, (_, one) in FILTERS.items() if one == said]
            end, one = said.replace(" ", "_").replace(".", "_"), leak.sel(filter=names)
            found[f"leak_plus_{end}"] = one.sel(condition="plus").max()
            found[f"leak_minus_{end}"] = one.sel(condition="minus, as printed").max()
            found[f"least_leak_minus_{end}"] = one.sel(condition="minus, as printed").min()
        return found

    order = metric(
        template=lambda self, answer: float(next(iter(self.filters(answer).values())).nstates)
    )
    drives_leak_most = metric(lambda leak_of_drives: leak_of_drives.max())
    drives_leak_at_100_hz = metric(
        template=lambda leak_of_drives: leak_of_drives.sel(frequency=100.0, method="nearest").max(
            "drive"
        )
    )

    @table
    def signs(self, leak: DataArray) -> Any:
        """Largest gain from u to r, over that of H_act alone."""
        rows = [
            [name, *(f"{float(leak.sel(filter=name, condition=c).max()):.2g}" for c in CONDITIONS)]
            for name in FILTERS
        ]
        return ["residual generator, plant", *CONDITIONS], rows

    @figure
    def figure_7_3(self, answer: Dataset) -> Figure:
        """The residual over time with either sign, and the part of u that remains on twelve
        drives.
        """
        drawn, (course, leaks) = figures.axes(1, 2, size=(9.5, 4.0))
        looks = ((figures.BLUE, 1.6), (figures.ORANGE, 1.0))
        for sign, (colour, width) in zip(CONDITIONS, looks, strict=True):
            one = 1e6 * answer["course"].sel(condition=sign)
            course.plot(answer["time"], one, color=colour, linewidth=width, label=f"sign: {sign}")
        course.plot(answer["time"], 1e6 * answer["fault"], "k:", label="fault")
        figures.label(
            course, x="time [s]", y=r"residual [$\mu$m]", title=f"{self.axis}, u of 1 V, figure 7.3"
        )
        course.set_yscale("symlog", linthresh=1.0)
        for one in answer["leak_of_drives"].values:
            leaks.loglog(FREQUENCY, one, color=figures.SKY, linewidth=0.7)
        wrong = answer["leak"].sel(filter=next(iter(FILTERS)), condition="minus, as printed")
        leaks.loglog(FREQUENCY, wrong, color=figures.ORANGE)
        figures.label(
            leaks, x="frequency [Hz]", y=r"u to r over $|H_{act}|$ [1]", title="left by the control"
        )
        course.plot([], [], color=figures.SKY, label="sign: plus, each of twelve drives")
        figures.legend_below(drawn, course)
        return drawn


def nominal_response(axis: Axis, frequency: RealArray = FREQUENCY) -> ComplexArray:
    """K_optn ACT (F,) [units/V] from the coefficients of Table 3.2, which the generators do not
    use.
    """
    num, den = transfer_coefficients(nominal_parameters(axis))
    s = 2j * np.pi * frequency
    found: ComplexArray = total_gain(axis) * np.polyval(num, s) / np.polyval(den, s)
    return found


def scratch(time: RealArray) -> RealArray:
    """False displacement [m] of a scratch that begins at SCRATCH, a raised cosine over time [s]."""
    start, length, size = SCRATCH
    share = (time - start) * VELOCITY / length
    wave = 0.5 * size * (1.0 - np.cos(2 * np.pi * share))
    return np.where((share > 0.0) & (share < 1.0), wave, 0.0)


def leaks_of(axis: Axis, filters: Mapping[str, StateSpace]) -> RealArray:
    """Gain from u to r over that of H_act alone (filter, condition, F).

    H_act is used as found, and with reversed sign for the condition that is wrong for the plant.
    """
    found = []
    for name, Q in filters.items():
        photo, act = _parts(Q)
        sign = PLANTS[FILTERS[name][1]]
        through = sign * photo * nominal_response(axis)
        found.append([abs(c * sign * act + through) / abs(act) for c in CONDITIONS.values()])
    return np.array(found, float)


def _parts(Q: StateSpace, frequency: RealArray = FREQUENCY) -> tuple[ComplexArray, ComplexArray]:
    """H_photo and H_act (F,) of a generator."""
    found = response(Q, 2 * np.pi * frequency)
    return found[:, 0, 0], found[:, 0, 1]


def _joined(Q: StateSpace, model: FaultModel) -> StateSpace:
    """(u, f_sd) -> r, plant and generator in series."""
    plant_ = model.system
    both = realisation(
        (
            plant_.A,
            plant_.B,
            np.vstack([plant_.C, np.zeros((1, plant_.nstates))]),
            np.vstack([plant_.D, [[1.0, 0.0]]]),
        ),
        0.0,
    )
    return Q * both


def _by_sign(leak: RealArray, right: bool) -> RealArray:
    """Gains (filter, F) with the sign that is right for the plant, or with the other one."""
    asked = [PLANTS[said] for _, said in FILTERS.values()]
    signs = list(CONDITIONS.values())
    chosen = [signs.index(one if right else -one) for one in asked]
    return leak[np.arange(len(chosen)), chosen]
