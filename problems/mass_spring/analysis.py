"""Mixed and complex mu of the two masses with a simple controller."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, figures, problem
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import Conditions, conditions, sweep, upper_bound
from workbench.program import worst
from workbench.structure import Structure
from workbench.uncertainty import GeneralisedPlant

from .equations import characteristic_roots, determinant, real_spring_mu
from .plant import simple_controller, two_mass_plant

QUESTIONS = ("performance", "stability")
KINDS = ("mixed", "complex")
CHANNELS = 4
"""Of N: two of the perturbation, two of the performance."""
SLACK = 1e-6
"""How far bounds of the same number may be out of order, relative."""
PEER = 1e-4
"""Relative distance from the bound of the conic solver, which meets its own tolerance."""
EXACT = 1e-3
"""How far the bound may lie above mu, relative: of a real and a complex scalar they are equal."""
FLOOR = 1e-6
"""What EXACT is relative to where mu is smaller."""
SINGULAR = 1e-6
"""|det(I - N Delta)| up to which N Delta has an eigenvalue of 1; without Delta it is 1."""
SPRINGS = 201
SHOWN, LEAST = (1e-2, 1e2), 1e-5
"""Frequencies [rad/s] shown, and the smallest mu."""


@problem("mass-spring/analysis")
def analysis(
    tolerance: Annotated[float, Field(gt=0, lt=0.5)] = 1e-3,
    peers: Annotated[int, Field(ge=1)] = 12,
) -> Analysis:
    """Robust performance and stability of two masses, their spring real and complex.

    Bounds of mu over frequency and their peaks certified over all frequencies, with the spring as
    the real scalar that it is and as a complex one, for u = 0.005 s / (s + 0.1) y.

    tolerance: of the certified peaks, relative. peers: frequencies at which CVXPY with Clarabel
    computes the upper bound again.
    """
    return Analysis(tolerance, peers)


@dataclass(frozen=True)
class Analysis(Study):
    """mu over frequency [rad/s] and its certified peaks."""

    tolerance: float
    peers: int

    headline: ClassVar[str] = "peak_mixed"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        K, plants = simple_controller(), _plants()
        found = {kind: conditions(p, K, tolerance=self.tolerance) for kind, p in plants.items()}
        cases = _cases(plants, K)
        grids = [sweep(system, structure).omega for system, structure in cases.values()]
        omega = np.unique(np.concatenate(grids))
        omega = omega[(omega > 0) & np.isfinite(omega)]
        sweeps = {case: sweep(*pair, omega, "best") for case, pair in cases.items()}
        shown = np.flatnonzero((omega >= SHOWN[0]) & (omega <= SHOWN[1]))
        some = shown[np.linspace(0, len(shown) - 1, self.peers).astype(int)]
        peer = [
            [_conic(sweeps[q, kind].M[some], cases[q, kind][1]) for kind in KINDS]
            for q in context.track(QUESTIONS, "conic bounds")
        ]
        peaks = {(q, kind): _peak(found[kind], q) for q in QUESTIONS for kind in KINDS}
        nominal = found["mixed"]
        assert nominal.nominal_performance is not None
        bounds = {
            name: [[getattr(sweeps[q, kind], name) for kind in KINDS] for q in QUESTIONS]
            for name in ("lower", "upper")
        }
        both, unit = ("question", "kind"), {"units": "1"}
        Delta = np.zeros((len(QUESTIONS), len(KINDS), CHANNELS, CHANNELS), complex)
        for i, q in enumerate(QUESTIONS):
            for j, kind in enumerate(KINDS):
                part = peaks[q, kind].Delta
                Delta[i, j, : len(part), : len(part)] = part
        return xr.Dataset(
            {
                "lower": ((*both, "omega"), np.array(bounds["lower"]), unit),
                "upper": ((*both, "omega"), np.array(bounds["upper"]), unit),
                "peer": ((*both, "peer_omega"), np.array(peer), unit),
                "peak": (
                    (*both, "bound"),
                    [[(peaks[q, k].lower, peaks[q, k].upper) for k in KINDS] for q in QUESTIONS],
                    unit | {"long_name": "bounds of the supremum of mu over all frequencies"},
                ),
                "peak_omega": (
                    both,
                    [[peaks[q, k].omega for k in KINDS] for q in QUESTIONS],
                    {"units": "rad/s"},
                ),
                "Delta": ((*both, "row", "column"), Delta, unit),
                "nominal_performance": ((), nominal.nominal_performance.upper, unit),
                "pole": ((), nominal.pole, {"units": "rad/s", "long_name": "rightmost pole"}),
            },
            coords={
                "question": list(QUESTIONS),
                "kind": list(KINDS),
                "omega": ("omega", omega, {"units": "rad/s"}),
                "peer_omega": ("peer_omega", omega[some], {"units": "rad/s"}),
                "bound": ["lower", "upper"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        omega, upper = answer["omega"].values, answer["upper"]
        cases = [f"{kind} {question}" for question in QUESTIONS for kind in KINDS]

        def place(index: tuple[int, ...]) -> str:
            *_, q, kind, point = index
            return f"{KINDS[kind]} {QUESTIONS[q]} at {omega[point]:.4g} rad/s"

        lower, where = worst((answer["lower"] / upper).values, place)
        real, at = worst(
            (upper.sel(kind="mixed") / upper.sel(kind="complex")).values,
            lambda i: f"{QUESTIONS[i[0]]} at {omega[i[1]]:.4g} rad/s",
        )
        peak = answer["peak"].sel(bound="upper")
        beyond, there = worst(
            (upper.max("omega") / peak).values, lambda i: cases[len(KINDS) * i[0] + i[1]]
        )
        peer = upper.sel(omega=answer["peer_omega"].values).values / answer["peer"].values

        def peer_place(index: tuple[int, ...]) -> str:
            return f"at {float(answer['peer_omega'][index[-1]]):.4g} rad/s"

        above, here = worst(peer - 1, peer_place)
        # Where stability hangs on a spring alone, G grows beyond what the conic solver resolves.
        off, somewhere = worst(abs(peer[QUESTIONS.index("performance")] - 1), peer_place)
        exact = real_spring_mu(answer["peer_omega"].values)
        stability = upper.sel(question="stability", kind="mixed")
        ratio = stability.sel(omega=answer["peer_omega"].values).values / exact
        reached, point = worst(1 / ratio, peer_place)
        apart = (ratio - 1) * exact / np.maximum(exact, FLOOR)
        tight, spot = worst(apart, peer_place)
        singular = [
            abs(determinant(float(one["peak_omega"]), one["Delta"].values))
            for one in (answer.sel(question=q, kind=kind) for q in QUESTIONS for kind in KINDS)
        ]
        left, case = worst(singular, lambda i: cases[i[0]])
        size, which = worst(self._sizes(answer), lambda i: cases[i[0]])
        roots = characteristic_roots(0.0)
        right = roots[np.argmax(roots.real)]
        pole = complex(answer["pole"])
        nearest = min(abs(pole - right), abs(pole - right.conjugate())) / abs(right)
        deltas = np.linspace(-1, 1, SPRINGS)
        spring = max(float(characteristic_roots(delta).real.max()) for delta in deltas)
        return [
            Check("nominal stability", "rightmost root of the loop [rad/s]", right.real, 0.0),
            Check("rightmost pole", "distance from that root, relative", nearest, SLACK),
            Check("every spring", "rightmost root over 1.2 to 2.8 N/m [rad/s]", spring, 0.0),
            Check("lower below upper", "lower over upper bound", lower, 1 + SLACK, where),
            Check("real below complex", "mixed over complex upper bound", real, 1 + SLACK, at),
            Check("peaks", "bound at a frequency over the certified peak", beyond, 1.0, there),
            Check("conic bounds", "excess over Clarabel's bound, relative", above, PEER, here),
            Check(
                "conic bounds of performance",
                "distance from Clarabel's bound, relative",
                off,
                PEER,
                somewhere,
            ),
            Check("never below mu", "mu of stability over its bound", reached, 1 + SLACK, point),
            Check("exact", "that bound above mu, relative or to 1e-6", tight, EXACT, spot),
            Check("singular", "|det(I - N Delta)| by the element equations", left, SINGULAR, case),
            Check("size of Delta", "times the lower bound, distance from 1", size, SLACK, which),
        ]

    def _sizes(self, answer: Dataset) -> list[float]:
        """How far Delta's largest singular value times the lower bound is from 1."""
        lower = answer["peak"].sel(bound="lower")
        return [
            float(abs(np.linalg.norm(one.values, 2) * float(lower.sel(question=q, kind=kind)) - 1))
            for q, kind, one in (
                (q, kind, answer["Delta"].sel(question=q, kind=kind))
                for q in QUESTIONS
                for kind in KINDS
            )
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for question, after in (("performance", ""), ("stability", "_stability")):
            for kind in KINDS:
                one = answer.sel(question=question, kind=kind)
                for name, bound in (("peak", "upper"), ("peak_lower", "lower")):
                    numbers[f"{name}_{kind}{after}"] = float(one["peak"].sel(bound=bound))
                numbers[f"frequency_{kind}{after}"] = float(one["peak_omega"])
        numbers["nominal_performance"] = float(answer["nominal_performance"])
        numbers["rightmost_pole"] = float(answer["pole"].real)
        return numbers

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, panels = figures.axes(2, 1, size=(7.0, 7.0), sharex=True)
        for panel, question in zip(panels, QUESTIONS, strict=True):
            # The mixed curves lie on the complex ones or below: they are drawn last and thinner.
            for kind, colour, width in (
                ("complex", figures.ORANGE, 2.6),
                ("mixed", figures.BLUE, 1),
            ):
                one = answer.sel(question=question, kind=kind)
                panel.loglog(
                    one["omega"], one["upper"], color=colour, lw=width, label=f"{kind}, upper"
                )
                panel.plot(
                    one["omega"],
                    one["lower"].where(one["lower"] > 0),
                    ":",
                    color=colour,
                    lw=width,
                    label=f"{kind}, lower",
                )
            panel.axhline(1.0, color=figures.BLACK, lw=0.8)
            panel.set_title(f"robust {question}")
            panel.set_ylabel("mu [1]")
            panel.set_xlim(*SHOWN)
            panel.set_ylim(bottom=LEAST)
        panels[-1].set_xlabel("angular frequency [rad/s]")
        figures.legend_below(figure, panels[0])
        return {"mu": figure}


def _plants() -> dict[str, GeneralisedPlant]:
    plant = two_mass_plant()
    assert plant.structure is not None
    return {"mixed": plant, "complex": replace(plant, structure=plant.structure.complexified())}


def _cases(
    plants: dict[str, GeneralisedPlant], K: StateSpace
) -> dict[tuple[str, str], tuple[StateSpace, Structure]]:
    """What Delta closes, and its structure, for each question and kind."""
    import control

    cases = {}
    for kind, plant in plants.items():
        N, structure = plant.close(K), plant.structure
        assert structure is not None
        rows, columns = structure.columns, structure.rows
        N11 = control.ss(N.A, N.B[:, :columns], N.C[:rows], N.D[:rows, :columns])
        cases["performance", kind] = N, plant.performance_structure
        cases["stability", kind] = N11, structure
    return cases


def _conic(M: np.ndarray, structure: Structure) -> np.ndarray:
    """Upper bounds by CVXPY and Clarabel."""
    value: np.ndarray = upper_bound(M, structure, "clarabel").value
    return value


def _peak(found: Conditions, question: str) -> Any:
    return found.robust_performance if question == "performance" else found.robust_stability
