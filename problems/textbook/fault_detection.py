"""Residuals for two failing actuators: exactly isolated, or matched to a reference
model in noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.linalg import expm

from workbench import Check, problem
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM
from workbench.diagnosis import (
    FaultModel,
    ModelMatch,
    attainable_structures,
    fault_detection,
    fault_isolation,
    matching_bound,
    model_matching,
    null_space_generator,
    residual_response,
)
from workbench.study import Study, array, check, dim, figure, metric, part, system
from workbench.systems import realisation
from workbench.types import Array, DataArray, Dataset, Figure, StateSpace

from . import fault_detection_figures as drawn
from .fault_examples import (
    SUBOPTIMAL,
    YUAN_ROWS,
    four_compartments,
    two_actuators,
    uncertain_dynamics,
    unstable_sensor,
    unstable_sensor_residual,
)

GENERATORS = ("exact", "approximate")
INPUTS = ("f_u1", "f_u2", "u1", "u2")
UNCERTAIN_VALUES = np.linspace(-0.25, 0.25, 5)
"""Values of each of the two uncertain parameters in the simulations, as in the book."""
STEP_DURATION = 10.0
"""Duration of the step responses [s]."""
CHECKED = np.geomspace(1.3e-3, 0.7e4, 97)
"""Angular frequencies [rad/s] of the checks."""
LEAKAGE = 1e-8
"""Largest gain accepted as zero; the other gains are about 1."""
POLE_DISTANCE = 1e-4
"""Largest accepted distance of a pole from the one asked for, relative."""
PEAK_DISTANCE = 1e-3
"""Largest accepted difference between the certified peak and another algorithm's, relative."""
GENERATOR_DISTANCE = 1e-8
"""Largest accepted distance from the published residual generator, relative."""


@problem("textbook/fault-detection")
def detection(
    pole: Annotated[float, Field(lt=0.0, allow_inf_nan=False)] = -10.0,
    frequencies: Annotated[int, Field(ge=20)] = 160,
) -> FaultDetection:
    """Two failing actuators told apart: exactly without noise, and best where there is noise.

    Varga's example 5.16 has two controls, two outputs, a fault of each actuator, and noise that
    represents two uncertain parameters. The exact residuals isolate both faults but let the noise
    through. The approximate residuals have the least H-infinity error against a first-order
    reference model. Both are tried on unit steps of faults and controls, with 25 plants of the
    uncertain set. Two more models of the literature give numbers to compare with: example 5.4 a
    residual generator, and that of Yuan and others the attainable structures.

    pole: pole of the residual generators and of the reference model [rad/s]. frequencies: number of
    frequencies at which the errors are computed.
    """
    return FaultDetection(two_actuators(), pole, frequencies)


@dataclass(frozen=True, eq=False)
class FaultDetection(Study):
    """Exact and approximate residuals of one model."""

    model: FaultModel
    pole: float
    frequencies: int

    headline: ClassVar[str] = "norm"

    @property
    def quantifier(self) -> str:
        return f"at {len(CHECKED)} frequencies, for this one model"

    @property
    def reference(self) -> StateSpace:
        """Reference model M_r = -pole / (s - pole) of each fault."""
        one = np.eye(2)
        return realisation((self.pole * one, one, -self.pole * one, 0.0 * one), 0.0)

    @part
    def match(self) -> ModelMatch:
        """The residual generator with the least error, and the certified norm of that error."""
        return model_matching(self.model, self.reference, self.pole)

    generator, residual, kind = dim(*GENERATORS), dim("r1", "r2"), dim("weak", "strong")
    curve, input = dim("nominal", "least", "most"), dim(*INPUTS)
    time = dim(lambda: np.linspace(0.0, STEP_DURATION, 151), unit="s")

    @part
    def omega(self) -> Array:
        return np.geomspace(1e-2, 1e3, self.frequencies)

    frequency = dim(lambda omega: omega / (2 * np.pi), unit="Hz")

    @system(generator, called="{}")
    def filters(self, match: ModelMatch) -> list[StateSpace]:
        return [fault_isolation(self.model, np.eye(2), self.pole, omega=0.0).Q, match.generator.Q]

    @system
    def example(self) -> StateSpace:
        return fault_detection(unstable_sensor(), -3.0, omega=0.0).Q

    @array(
        dims=(generator, frequency),
        unit="1",
        meaning="largest singular value of the matching error",
    )
    def error(self, filters: Any, omega: Array) -> list[Array]:
        return [np.linalg.norm(self._error(Q, omega), 2, axis=(1, 2)) for Q in filters]

    @array(dims=frequency, unit="1", meaning="no generator has less")
    def bound(self, omega: Array) -> Array:
        any_residual = null_space_generator(self.model, self.pole).Q
        return matching_bound(self.model, any_residual, self.reference, omega)

    norm = array(
        dims=(), unit="1", meaning="certified norm of the error", value=lambda match: match.norm
    )

    @array(
        dims=(generator, curve, time, residual, input),
        unit="1",
        meaning="residual after a unit step",
    )
    def step(self, filters: Any, time: DataArray) -> list[Array]:
        return [_envelope(Q, self.model, time.values) for Q in filters]

    @array(dims=kind, unit="1", meaning="attainable rows of the structure matrix, Yuan et al.")
    def structures(self) -> list[int]:
        return [
            len(attainable_structures(four_compartments(), omega=at)) for at in (None, (0.0, 1.0))
        ]

    def _error(self, Q: StateSpace, omega: Array) -> Array:
        """Matching error R - [M_r 0] (F, 2, 4)."""
        found = residual_response(Q, self.model, (*self.model.faults, *self.model.noise), omega)
        found[:, :, :2] -= (-self.pole / (1j * omega - self.pole))[:, None, None] * np.eye(2)
        return found

    # --- checks, from the stored matrices alone -----------------------------------------------

    @check()
    def decoupled(self, filters: dict[str, StateSpace]) -> list[Check]:
        """Every generator is stable, and no control reaches its residuals."""
        found, statement = [], "largest gain from a control to a residual [1]"
        pole = "real part of its slowest pole [rad/s]"
        for name, Q in filters.items():
            slowest = float(np.linalg.eigvals(Q.A).real.max())
            gain = np.abs(self._residual_response(Q, self.model.controls, CHECKED)).max(axis=(1, 2))
            where = f"at {CHECKED[np.argmax(gain)]:.4g} rad/s"
            found += [
                Check(f"poles {name}", pole, slowest, -1e-9, over=THIS_SYSTEM),
                Check(f"decoupling {name}", statement, float(gain.max()), LEAKAGE, where=where),
            ]
        return found

    @check(
        title="poles given",
        statement="relative distance of a pole from the given one",
        at_most=POLE_DISTANCE,
    )
    def poles(self, filters: dict[str, StateSpace]) -> float:
        poles: Array = np.linalg.eigvals(filters["exact"].A)
        return float(np.abs(poles / self.pole - 1.0).max())

    @check(title="isolation", statement="largest gain from the other fault [1]", at_most=LEAKAGE)
    def isolation(self, filters: dict[str, StateSpace]) -> float:
        G_rf = self._residual_response(filters["exact"], self.model.faults, np.append(0.0, CHECKED))
        return float(np.abs(G_rf[:, [0, 1], [1, 0]]).max())

    @check(title="gain", statement="distance of the static gain from 1", at_most=LEAKAGE)
    def gain(self, filters: dict[str, StateSpace]) -> float:
        G_rf = self._residual_response(filters["exact"], self.model.faults, np.array([0.0]))
        return float(np.abs(G_rf[0] - np.eye(2)).max())

    @check(over=EVERY_FREQUENCY)
    def best(
        self, filters: dict[str, StateSpace], norm: DataArray, bound: DataArray
    ) -> list[Check]:
        """The certified norm equals the peak of the error, and is close to the least
        possible norm.
        """
        residual = _residual_matrices(filters["approximate"], self.model, self.model.system.A)
        again, certified = _peak_gain(residual, self.reference), float(norm)
        over = "peak of the error by another algorithm over the certified norm, less 1"
        under = "certified norm over that peak, less 1"
        near, excess = (
            "certified norm less the least norm of any generator [1]",
            certified - float(bound.max()),
        )
        return [
            Check("norm", over, again / certified - 1.0, PEAK_DISTANCE),
            Check("norm reached", under, certified / again - 1.0, PEAK_DISTANCE),
            Check("near the best", near, excess, SUBOPTIMAL),
        ]

    @check(
        title="example 5.4",
        statement="distance from the published residual generator, relative",
        at_most=GENERATOR_DISTANCE,
    )
    def published(self, example: StateSpace) -> float:
        published = unstable_sensor_residual(1j * CHECKED)
        ours = _response(example, CHECKED)
        gain = (ours * published.conj()).sum() / (np.abs(published) ** 2).sum()
        return float(np.abs(ours - gain * published).max() / abs(gain))

    attained = check(
        title="structures {kind}",
        statement="difference of the number of attainable rows from the published number",
        value=lambda structures: abs(
            structures - [YUAN_ROWS[kind] for kind in structures["kind"].values]
        ),
        at_most=0.0,
        each="kind",
    )

    def _residual_response(self, Q: StateSpace, names: tuple[str, ...], omega: Array) -> Array:
        """Response (F, 2, m) from controls or faults to the residuals, computed from the stored
        matrices.
        """
        system = self.model.system
        columns = [list(system.input_labels).index(name) for name in names]
        plant = realisation((system.A, system.B[:, columns], system.C, system.D[:, columns]), 0.0)
        y = _response(plant, omega)
        filtered = _response(Q, omega)
        given = filtered[:, :, 2:] if names == self.model.controls else 0.0
        return filtered[:, :, :2] @ y + given

    # --- metrics and figures --------------------------------------------------------------------

    certified = metric("norm", value=lambda norm: norm)
    least = metric("bound", value=lambda bound: bound.max())
    norm_exact = metric(lambda error: error.sel(generator="exact").max())
    rows = metric(lambda structures: structures)

    @metric
    def of_generators(self, answer: Dataset) -> dict[str, float]:
        final = answer["step"].isel(time=-1)
        nominal, found = final.sel(curve="nominal"), {}
        for name in GENERATORS:
            one = final.sel(generator=name, input=["u1", "u2"])
            found[f"control_leak_{name}"] = float(np.abs(one.sel(curve=["least", "most"])).max())
            own = [float(nominal.sel(generator=name).values[k, k]) for k in range(2)]
            found[f"fault_gain_{name}"] = min(own)
            found[f"order_{name}"] = float(answer.sizes[f"{name}_state"])
        return found

    @figure
    def shown(self, answer: Dataset) -> dict[str, Figure]:
        return {"steps": drawn.steps(answer), "matching": drawn.matching(answer)}


def _residual_matrices(
    Q: StateSpace, model: FaultModel, A: Array
) -> tuple[Array, Array, Array, Array]:
    """State-space matrices from (faults, noise, controls) to the residuals, for a plant with this
    `A`.
    """
    faults, controls = len(model.faults), len(model.controls)
    names = (*model.faults, *model.noise, *model.controls)
    system = model.system
    columns = [list(system.input_labels).index(name) for name in names]
    B, D = system.B[:, columns], system.D[:, columns]
    given = np.zeros((controls, len(names)))
    given[:, faults + len(model.noise) :] = np.eye(controls)
    p = int(system.noutputs)
    to_y, to_u = Q.B[:, :p], Q.B[:, p:]
    return (
        np.block([[A, np.zeros((len(A), Q.nstates))], [to_y @ system.C, Q.A]]),
        np.vstack([B, to_y @ D + to_u @ given]),
        np.hstack([Q.D[:, :p] @ system.C, Q.C]),
        Q.D[:, :p] @ D + Q.D[:, p:] @ given,
    )


def _envelope(Q: StateSpace, model: FaultModel, time: Array) -> Array:
    """Step responses (3, T, 2, 4): nominal plant, and pointwise least and largest of the uncertain
    plants.
    """
    curves = [
        _steps(_residual_matrices(Q, model, uncertain_dynamics(rho1, rho2)), time)
        for rho1 in UNCERTAIN_VALUES
        for rho2 in UNCERTAIN_VALUES
    ]
    nominal = _steps(_residual_matrices(Q, model, uncertain_dynamics(0.0, 0.0)), time)
    return np.array([nominal, np.min(curves, axis=0), np.max(curves, axis=0)])


def _steps(matrices: tuple[Array, Array, Array, Array], time: Array) -> Array:
    """Responses to unit steps of faults and controls (T, residuals, inputs), exact at
    the samples.
    """
    A, B, C, D = matrices
    columns = [0, 1, B.shape[1] - 2, B.shape[1] - 1]
    B, D = B[:, columns], D[:, columns]
    n, m = B.shape
    both = np.block([[A, B], [np.zeros((m, n + m))]])
    move = expm(both * (time[1] - time[0]))[:n]
    x, found = np.zeros((n, m)), []
    for _ in time:
        found.append(C @ x + D)
        x = move[:, :n] @ x + move[:, n:]
    return np.array(found)


def _response(system: Any, omega: Array) -> Array:
    """Frequency response C (j omega I - A)^-1 B + D, (F, outputs, inputs)."""
    s = 1j * np.asarray(omega)[:, None, None]
    return system.C @ np.linalg.solve(s * np.eye(len(system.A)) - system.A, system.B) + system.D


def _peak_gain(residual: tuple[Array, ...], reference: StateSpace) -> float:
    """H-infinity norm of R - [M_r 0] without the controls, by SLICOT AB13DD."""
    from scipy.linalg import block_diag
    from slycot import ab13dd

    A, B, C, D = residual
    w = B.shape[1] - 2
    padded = np.hstack([reference.B, np.zeros((len(reference.A), w - 2))])
    A, C = block_diag(A, reference.A), np.hstack([C, -reference.C])
    B, D = np.vstack([B[:, :w], padded]), D[:, :w]
    n = len(A)
    return float(ab13dd("C", "I", "S", "D", n, w, len(C), A, np.eye(n), B, C, D, 1e-8)[0])
