"""Residuals for two failing actuators: isolated exactly, and matched to a model in noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.linalg import expm

from workbench import Check, Study, problem
from workbench.arrays import Array
from workbench.diagnosis import (
    FaultModel,
    attainable_structures,
    fault_detection,
    fault_isolation,
    matching_bound,
    model_matching,
    null_space_generator,
    transfer,
)
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.program import worst
from workbench.systems.realisation import realisation
from workbench.systems.storage import restored, stored

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
SPREAD = np.linspace(-0.25, 0.25, 5)
"""Of both uncertain parameters, as the book simulates."""
DURATION = 10.0
"""Of the step responses [s]."""
DECOUPLED = 1e-8
"""Of a gain that must be 0, beside gains of about 1."""
PEAK = 1e-3
"""Of a peak found again by another algorithm, relative."""


@problem("textbook/fault-detection")
def detection(
    pole: Annotated[float, Field(lt=0.0, allow_inf_nan=False)] = -10.0,
    frequencies: Annotated[int, Field(ge=20)] = 160,
) -> FaultDetection:
    """Two failing actuators told apart: exactly without noise, and best where there is noise.

    Varga's example 5.16: two controls, two outputs, a fault of each actuator, noise that stands
    for two uncertain parameters. The exact residuals isolate both faults and let the noise
    through; the approximate ones are those with the least H-infinity error against a reference
    model of first order. Steps of faults and controls on 25 plants of the uncertain set show what
    either is worth. Two more models of the literature give numbers to compare with: example 5.4
    its residual generator, that of Yuan and others the structures that can be attained.

    pole: of the residual generators and of the reference model [rad/s]. frequencies: how many.
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
    def reference(self) -> StateSpace:
        """M_r = -pole / (s - pole) for each fault."""
        one = np.eye(2)
        return realisation((self.pole * one, one, -self.pole * one, 0.0 * one), 0.0)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        model = self.model
        exact = fault_isolation(model, np.eye(2), self.pole, omega=0.0)
        match = model_matching(model, self.reference, self.pole)
        omega = np.geomspace(1e-2, 1e3, self.frequencies)
        filters = {"exact": exact.Q, "approximate": match.generator.Q}
        errors = [np.linalg.norm(self._error(Q, omega), 2, axis=(1, 2)) for Q in filters.values()]
        bound = matching_bound(
            model, null_space_generator(model, self.pole).Q, self.reference, omega
        )
        time = np.linspace(0.0, DURATION, 151)
        steps = [_envelope(Q, model, time) for Q in filters.values()]
        weak, strong = (attainable_structures(four_compartments(), at) for at in (None, (0.0, 1.0)))
        unit = {"units": "1"}
        size = unit | {"long_name": "largest singular value of the matching error"}
        step = unit | {"long_name": "residual after a unit step"}
        return xr.Dataset(
            {
                "error": (("generator", "frequency"), errors, size),
                "bound": (("frequency",), bound, unit | {"long_name": "no generator has less"}),
                "norm": ((), match.norm, unit | {"long_name": "certified norm of the error"}),
                "step": (("generator", "curve", "time", "residual", "input"), steps, step),
                "structures": (
                    ("kind",),
                    [len(weak), len(strong)],
                    unit | {"long_name": "attainable rows of the structure matrix, Yuan et al."},
                ),
                **stored("exact", exact.Q),
                **stored("approximate", match.generator.Q),
                **stored("example", fault_detection(unstable_sensor(), -3.0, omega=0.0).Q),
            },
            coords={
                "generator": list(GENERATORS),
                "frequency": ("frequency", omega / (2 * np.pi), {"units": "Hz"}),
                "time": ("time", time, {"units": "s"}),
                "curve": ["nominal", "least", "most"],
                "residual": ["r1", "r2"],
                "input": list(INPUTS),
                "kind": ["weak", "strong"],
            },
        )

    def _error(self, Q: StateSpace, omega: Array) -> Array:
        """R - [M_r 0] (F, 2, 4)."""
        found = transfer(Q, self.model, (*self.model.faults, *self.model.noise), omega)
        found[:, :, :2] -= (-self.pole / (1j * omega - self.pole))[:, None, None] * np.eye(2)
        return found

    # --- checks, from the stored matrices alone -----------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        omega = np.geomspace(1.3e-3, 0.7e4, 97)
        found = []
        filters = {name: restored(answer, name) for name in GENERATORS}
        for name, Q in filters.items():
            poles = np.linalg.eigvals(Q.A)
            slowest = float(poles.real.max())
            found.append(
                Check(f"poles {name}", "real part of its slowest pole [rad/s]", slowest, -1e-9)
            )
            leak, where = worst(
                np.abs(self._through(Q, self.model.controls, omega)).max(axis=(1, 2)),
                lambda k: f"at {omega[k[0]]:.4g} rad/s",
            )
            found.append(
                Check(f"decoupling {name}", "largest gain from a control", leak, DECOUPLED, where)
            )
        poles = np.linalg.eigvals(filters["exact"].A)
        moved = float(np.abs(poles / self.pole - 1.0).max())
        found.append(Check("poles given", "distance of a pole from the one asked", moved, 1e-4))
        G_rf = self._through(filters["exact"], self.model.faults, np.append(0.0, omega))
        crossed = np.abs(G_rf[:, [0, 1], [1, 0]]).max()
        found.append(Check("isolation", "largest gain from the other fault", crossed, DECOUPLED))
        missed = np.abs(G_rf[0] - np.eye(2)).max()
        found.append(Check("gain", "distance of the static gain from 1", missed, DECOUPLED))
        found += self._norm_checks(answer, filters["approximate"])
        s = 1j * omega
        published = unstable_sensor_residual(s)
        ours = _response(restored(answer, "example"), omega)
        gain = (ours * published.conj()).sum() / (np.abs(published) ** 2).sum()
        off = float(np.abs(ours - gain * published).max() / abs(gain))
        statement = "distance from the published residual generator, relative"
        found.append(Check("example 5.4", statement, off, 1e-8))
        for kind, rows in YUAN_ROWS.items():
            off = abs(float(answer["structures"].sel(kind=kind)) - rows)
            found.append(
                Check(f"structures {kind}", "attainable rows, less those published", off, 0.0)
            )
        return found

    def _norm_checks(self, answer: Dataset, Q: StateSpace) -> list[Check]:
        norm, bound = float(answer["norm"]), float(answer["bound"].max())
        again = _peak_gain(_joined(Q, self.model, self.model.system.A), self.reference)
        statement = "peak of the error by another algorithm over the certified norm, less 1"
        return [
            Check("norm", statement, again / norm - 1.0, PEAK),
            Check(
                "norm reached", "certified norm over that peak, less 1", norm / again - 1.0, PEAK
            ),
            Check(
                "near the best",
                "certified norm less the bound of any generator",
                norm - bound,
                SUBOPTIMAL,
            ),
        ]

    def _through(self, Q: StateSpace, names: tuple[str, ...], omega: Array) -> Array:
        """From controls or faults to the residuals, by solving with the stored matrices."""
        system = self.model.system
        columns = [list(system.input_labels).index(name) for name in names]
        plant = realisation((system.A, system.B[:, columns], system.C, system.D[:, columns]), 0.0)
        y = _response(plant, omega)
        filtered = _response(Q, omega)
        given = filtered[:, :, 2:] if names == self.model.controls else 0.0
        return filtered[:, :, :2] @ y + given

    # --- what people look at --------------------------------------------------------------------

    def metrics(self, answer: Dataset) -> dict[str, float]:
        final = answer["step"].isel(time=-1)
        nominal = final.sel(curve="nominal")
        found = {
            "norm": float(answer["norm"]),
            "bound": float(answer["bound"].max()),
            "norm_exact": float(answer["error"].sel(generator="exact").max()),
            "rows_weak": float(answer["structures"].sel(kind="weak")),
            "rows_strong": float(answer["structures"].sel(kind="strong")),
        }
        for name in GENERATORS:
            one = final.sel(generator=name, input=["u1", "u2"])
            found[f"control_leak_{name}"] = float(np.abs(one.sel(curve=["least", "most"])).max())
            own = [float(nominal.sel(generator=name).values[k, k]) for k in range(2)]
            found[f"fault_gain_{name}"] = min(own)
            found[f"order_{name}"] = float(answer.sizes[f"{name}_state"])
        return found

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"steps": drawn.steps(answer), "matching": drawn.matching(answer)}


def _joined(Q: StateSpace, model: FaultModel, A: Array) -> tuple[Array, Array, Array, Array]:
    """Matrices from (faults, noise, controls) to the residuals, the plant having `A`."""
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
    """Steps on the nominal plant, and the least and most of the uncertain ones: (3, T, 2, 4)."""
    curves = [
        _steps(_joined(Q, model, uncertain_dynamics(rho1, rho2)), time)
        for rho1 in SPREAD
        for rho2 in SPREAD
    ]
    nominal = _steps(_joined(Q, model, uncertain_dynamics(0.0, 0.0)), time)
    return np.array([nominal, np.min(curves, axis=0), np.max(curves, axis=0)])


def _steps(matrices: tuple[Array, Array, Array, Array], time: Array) -> Array:
    """Unit steps of faults and controls (T, residuals, inputs), exact at the samples."""
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
    """C (j omega - A)^-1 B + D."""
    s = 1j * np.asarray(omega)[:, None, None]
    return system.C @ np.linalg.solve(s * np.eye(len(system.A)) - system.A, system.B) + system.D


def _peak_gain(residual: tuple[Array, ...], reference: StateSpace) -> float:
    """SLICOT AB13DD of R - [M_r 0], the controls left out."""
    from scipy.linalg import block_diag
    from slycot import ab13dd

    A, B, C, D = residual
    w = B.shape[1] - 2
    padded = np.hstack([reference.B, np.zeros((len(reference.A), w - 2))])
    A, C = block_diag(A, reference.A), np.hstack([C, -reference.C])
    B, D = np.vstack([B[:, :w], padded]), D[:, :w]
    n = len(A)
    return float(ab13dd("C", "I", "S", "D", n, w, len(C), A, np.eye(n), B, C, D, 1e-8)[0])
