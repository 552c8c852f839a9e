"""Mixed H2/H-infinity synthesis as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, relative_excess
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.mu.frequency.norms import SUM_ROUNDING, h2_norm
from workbench.second_opinion import loops
from workbench.second_opinion.powers import root_energy
from workbench.synthesis.families.several_plants import closed_side_by_side
from workbench.synthesis.families.synthesis import ControllerSynthesis
from workbench.synthesis.h2.direct import DIRECT_TERM_ROUNDING, cancelling_gain, direct_term
from workbench.synthesis.h2.program import CLAIM_TOLERANCE, LEAST_TOLERANCE, h2_loop
from workbench.synthesis.h_infinity import figures as drawn
from workbench.synthesis.h_infinity.assumptions import need_all_stabilisable, need_stabilisable
from workbench.synthesis.h_infinity.program import CLAIM_TOLERANCE as NORM_ROUNDING
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible
from workbench.systems.realisation import in_words, matrices_of, pole_sizes
from workbench.systems.standard_plant import standard_plant
from workbench.systems.storage import restored_system, stored_system

BOUND_TOLERANCE = 1e-4
"""Share by which the H2 norm may exceed the bound that a common Lyapunov matrix gives."""


@dataclass(frozen=True, eq=False, repr=False)
class H2HinfController(drawn.DrawnController):
    """A controller u = K y with positive feedback, and both norms of its loop.

    Unlike a `StateSpace`, it has two proven norms of its loop.

    ``norm`` is the H2 norm of the performance channels and ``hinf_norm`` the H-infinity norm of the
    perturbation channels; both are proven upper bounds. ``bound`` is the bound on the H2 norm that
    one Lyapunov matrix common to both norms proves; NaN if there is none. The conic methods
    minimise this bound, not the norm. ``least`` is the H2 norm of the best controller without the
    limit; NaN if it is not known.

    Examples
    --------
    >>> from workbench.synthesis import H2HinfController
    >>> import control
    >>> H2HinfController(control.ss([], [], [], [[2.0]]), norm=1.0, hinf_norm=0.5).lti.D.tolist()
    [[2.0]]
    """

    K: StateSpace
    norm: float
    hinf_norm: float
    bound: float = field(default=math.nan, kw_only=True)
    least: float = field(default=math.nan, kw_only=True)

    @property
    def lti(self) -> StateSpace:
        """The controller."""
        return self.K

    def summary(self) -> str:
        least = "" if math.isnan(self.least) else f", the least without limit {self.least:.6g}"
        return (
            f"H2HinfController: {in_words(self.K)}\n  H2 norm {self.norm:.6g}{least}, "
            f"H-infinity norm {self.hinf_norm:.6g}"
        )


@dataclass(frozen=True, eq=False)
class H2HinfSynthesis(ControllerSynthesis):
    """The K with the least H2 norm of the performance under a limit on an H-infinity norm.

    The H2 norm is taken from the exogenous inputs to the performance outputs. The limited
    H-infinity norm is taken from the perturbation inputs to the perturbation outputs: the loop
    stays stable for every perturbation smaller than 1 / gamma (small gain theorem).

    Parameters
    ----------
    plant
        Generalised plant with a perturbation, exogenous inputs and performance outputs. In
        continuous time the H2 norm is infinite unless a gain cancels the direct term from exogenous
        to performance.
    gamma
        Limit on the H-infinity norm of the perturbation channels.
    order, family, stable, fastest_pole, largest_gain, start, random
        As in `HinfSynthesis`.
    further_plants
        As in `HinfSynthesis`, each with a perturbation. Each of both norms is the largest over all
        loops.

    Conic solvers find a controller with as many states as the plant, with one Lyapunov matrix
    common to both norms. This makes the problem convex, but minimises only an upper bound on the H2
    norm: the norm itself is lower, and other controllers may be better. Method "fixed" minimises
    the norm itself over controllers of an order or a family, to a local optimum.

    Raises
    ------
    InputError
        The plant has no perturbation, no performance, or cannot be stabilised; gamma is not
        positive and finite; every loop has an infinite H2 norm; or a requirement on the controller
        is not valid or does not fit.

    References
    ----------
    C. Scherer, P. Gahinet, M. Chilali, Multiobjective output-feedback control via LMI optimization,
    IEEE Trans. Automatic Control 42 (1997) 896-911.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.structure import Full
    >>> from workbench.synthesis import H2HinfSynthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> plant = generalised_plant(
    ...     [(G, "v", "x")],
    ...     {"v": "u + d + delta", "y": "x + n"},
    ...     perturbation=[(Full(1, 1), "u", "delta")],
    ...     exogenous=["d", "n"],
    ...     performance=["x", "u"],
    ...     control="u",
    ...     measurement="y",
    ... )
    >>> solution = wb.solve(H2HinfSynthesis(plant, 2.2))
    >>> answer = solution.answer
    >>> solution.certificate.holds, bool(answer.hinf_norm <= 2.2)
    (True, True)
    >>> bool(answer.least <= answer.norm <= answer.bound)
    True
    """

    gamma: float

    default_method: ClassVar[str] = "clarabel"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.mixed_norms.conic",
        "workbench.synthesis.mu.structured.least_mixed",
    )
    headline: ClassVar[str] = "norm"

    def __post_init__(self) -> None:
        need_plant(self.plant)
        need_positive(self.gamma, "gamma")
        object.__setattr__(self, "plant", visible(self.plant))
        need_stabilisable(standard_plant(self.plant))
        self._set_form()
        need_all_stabilisable(self.further_plants)
        for number, plant in enumerate(self.plants):
            name = f"further plant {number}" if number else "the plant"
            if plant.structure is None:
                raise InputError(
                    f"{name} has no perturbation, whose channels' H-infinity norm is limited: give "
                    'perturbation=[(Full(1, 1), "z", "w")]; without a limit it is H2Synthesis'
                )
            if not (plant.exogenous and plant.performance):
                raise InputError(
                    f"{name} has {plant.exogenous} exogenous inputs and {plant.performance} "
                    "performance outputs; the H2 norm needs one of each at least"
                )
            if not plant.system.dt:
                cancelling_gain(standard_plant(plant.nominal()))

    @property
    def closed_plant(self) -> GeneralisedPlant:
        return self.plant

    def objective(self, answer: H2HinfController) -> float:
        """The H2 norm of the closed loop."""
        return answer.norm

    def h2_norm(self, controller: StateSpace) -> float:
        """The largest proven H2 norm of a controller's loops, which are stable."""
        return max(h2_norm(h2_loop(plant.nominal(), controller)).upper for plant in self.plants)

    def limited_loop(self, controller: StateSpace) -> StateSpace:
        """The loops whose H-infinity norm is limited, as one block diagonal system."""
        return closed_side_by_side([plant.perturbation() for plant in self.plants], controller)

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: H2HinfController, tolerance: float) -> list[Check]:
        K = answer.K
        fits = (K.noutputs, K.ninputs) == (self.plant.controls, self.plant.measurements)
        statement = "whether K has other outputs and inputs than controls and measurements"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        found += [stability_check(self.loop(K)), *self.demands.checks(K)]
        if not found[1].holds:
            return found
        if not self.plant.system.dt:
            statement = "direct term of the loop, w -> z, over the terms that cancel"
            value = max(direct_term(standard_plant(plant.nominal()), K.D) for plant in self.plants)
            found.append(Check("direct", statement, value, DIRECT_TERM_ROUNDING, over=THIS_SYSTEM))
        statement = "proven H2 norm of the loop over the claimed one, less 1"
        value = relative_excess(self.h2_norm(K), answer.norm)
        found.append(
            Check("norm", statement, value, CLAIM_TOLERANCE, over=THIS_SYSTEM, proven=True)
        )
        size = certified_norm(self.limited_loop(K))
        for name, claimed in (("H-infinity norm", answer.hinf_norm), ("limit", self.gamma)):
            of = "gamma" if name == "limit" else "the claimed one"
            statement = f"certified H-infinity norm of the perturbation channels over {of}, less 1"
            limit = NORM_ROUNDING if name != "limit" else 0.0
            value = relative_excess(size, claimed)
            found.append(Check(name, statement, value, limit, over=EVERY_FREQUENCY, proven=True))
        if not math.isnan(answer.bound):
            statement = "H2 norm over the bound by a common Lyapunov matrix, less 1"
            value = relative_excess(answer.norm, answer.bound)
            found.append(Check("bound", statement, value, BOUND_TOLERANCE, over=THIS_SYSTEM))
        if not math.isnan(answer.least):
            statement = "least H2 norm without the limit over the norm that this one has, less 1"
            value = relative_excess(answer.least, answer.norm)
            found.append(Check("least", statement, value, LEAST_TOLERANCE, over=THIS_SYSTEM))
        return found

    def second_opinion(self, answer: H2HinfController) -> list[Check]:
        K, whole = answer.K, self.loop(answer.K)
        each = [h2_loop(plant.nominal(), K) for plant in self.plants]
        size = max(root_energy(*matrices_of(one), float(one.dt or 0.0)) for one in each)
        statement = "H2 norm of the loop, as a sum over samples, over the claimed one, less 1"
        channels = [plant.perturbation() for plant in self.plants]
        sampled = (
            loops.gain(one.system, K, None, answer.hinf_norm, poles=one.close(K).poles())
            for one in channels
        )
        return [
            loops.powers_fall(whole.A, whole.dt),
            Check(
                "summed",
                statement,
                relative_excess(size, answer.norm),
                SUM_ROUNDING,
                over=THIS_SYSTEM,
            ),
            max(sampled, key=lambda check: check.value),
            *self._norm_checks(answer, size),
        ]

    def _norm_checks(self, answer: H2HinfController, size: float) -> list[Check]:
        """Checks that the H2 norm, as a sum over samples, lies between the claimed bounds."""
        statement = "H2 norm, as a sum over samples, over the bound by a common Lyapunov matrix"
        claims = {"summed below the bound": (size, answer.bound, statement)}
        statement = "least H2 norm without the limit over the norm as a sum over samples"
        claims["summed above the least"] = answer.least, size, statement
        return [
            Check(
                name,
                f"{said}, less 1",
                relative_excess(low, high),
                BOUND_TOLERANCE,
                over=THIS_SYSTEM,
            )
            for name, (low, high, said) in claims.items()
            if not (math.isnan(low) or math.isnan(high))
        ]

    def facts(self, answer: H2HinfController) -> Sequence[str]:
        said = [f"controller: {in_words(answer.K)}"]
        if not math.isnan(answer.bound):
            said.append(
                f"the bound {answer.bound:.4g} of the H2 norm is the least for one Lyapunov matrix "
                "common to both norms, and above the least norm of all controllers"
            )
        if answer.least > 0:
            said.append(
                f"H2 norm {answer.norm:.4g} reached; that of the best controller without the limit "
                f"is {answer.least:.4g}: distance {answer.norm / answer.least - 1:.1%} at most"
            )
        return said

    def metrics(self, answer: H2HinfController) -> dict[str, float]:
        return {
            "norm": answer.norm,
            "hinf_norm": answer.hinf_norm,
            "order": float(answer.K.nstates),
            "fastest_pole_rad_s": float(pole_sizes(answer.K).max(initial=0.0)),
            "stable_controller": float(stability_check(answer.K).holds),
        }

    def answer(
        self, controller: StateSpace, *, bound: float = math.nan, least: float = math.nan
    ) -> H2HinfController | None:
        """The answer for a controller; None if a loop is unstable or exceeds the limit."""
        K = self.plant.named(controller)
        if not stability_check(self.loop(K)).holds:
            return None
        try:
            norm = self.h2_norm(K)
        except InputError:  # rounding hides whether a pole is stable
            return None
        size = certified_norm(self.limited_loop(K))
        if not (math.isfinite(norm) and size <= self.gamma):
            return None
        return H2HinfController(K, norm, size, bound=bound, least=least)

    # --- datasets and figures -----------------------------------------------------------------

    def figures(self, answer: H2HinfController) -> dict[str, Figure]:
        return {
            "loop": drawn.loop(self.plant.perturbation().close(answer.K), self.gamma),
            "controller": drawn.controller(answer.K, self.plant.close(answer.K)),
        }

    def to_dataset(self, answer: H2HinfController) -> Dataset:
        import xarray as xr

        words = {
            "norm": "H2 norm of the performance",
            "hinf_norm": "H-infinity norm of the perturbation channels",
            "bound": "bound of the H2 norm by a common Lyapunov matrix",
            "least": "least H2 norm without the limit",
        }
        return xr.Dataset(
            {
                **stored_system("plant", self.plant.system),
                **stored_system("controller", answer.K),
                **{
                    name: ((), getattr(answer, name), {"units": "1", "long_name": said})
                    for name, said in words.items()
                },
            }
        )

    def from_dataset(self, data: Dataset) -> H2HinfController:
        K = self.plant.named(restored_system(data, "controller"))
        norm, size, bound, least = (
            float(data[name]) for name in ("norm", "hinf_norm", "bound", "least")
        )
        return H2HinfController(K, norm, size, bound=bound, least=least)
