"""Mu synthesis as a Program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_PERTURBATION, Check, quantified_checks, relative_excess
from workbench.certify.norms import NORM_TOLERANCE, certified_norm
from workbench.certify.proofs.scaled_system import ScalingFunctions
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import need_positive
from workbench.mu import Peak, peak, performance_peak
from workbench.mu.frequency.peak_bounds import peak_checks, restored_peak, stored_peak
from workbench.mu.frequency.scaled_peak import scaled_peak
from workbench.program import Claim, Program, Task, find_method
from workbench.second_opinion import loops
from workbench.solvers import Outcome
from workbench.structure import Structure
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import (
    Family,
    asked_of,
    family_for,
    need_continuous_plant,
    need_draws,
    need_form_for_all,
    started,
)
from workbench.synthesis.families.integral_action import integral_check, with_integrator
from workbench.synthesis.families.several_plants import (
    closed_side_by_side,
    further,
    joint_structure,
)
from workbench.synthesis.h_infinity.assumptions import need_all_stabilisable
from workbench.synthesis.h_infinity.figures import controller
from workbench.synthesis.h_infinity.singular_plants.absorbed import (
    Absorbed,
    between_poles,
    loop_gains,
    tested,
)
from workbench.synthesis.mu.figures import bounds_figure, rounds_figure
from workbench.synthesis.mu.member_figures import drawn_loops, performance_figure, steps_figure
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.rounds import Iterate, round_variables, rounds_of
from workbench.synthesis.no_controller.claim import no_controller
from workbench.synthesis.no_controller.interlacing import violated, words
from workbench.systems.balancing import balanced
from workbench.systems.bilinear import bilinear_continuous, bilinear_sampled, in_continuous_plane
from workbench.systems.conversion import need_plant
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible
from workbench.systems.margins import highest_crossover
from workbench.systems.realisation import in_words, pole_sizes, realisation
from workbench.systems.storage import restored_system, stored_system

PEAK_TOLERANCE = 1e-3
"""Relative tolerance of certified peaks."""
BOUND_ROUNDING = 1e-9
"""Relative difference between bounds of the same loop that counts as rounding."""


@dataclass(frozen=True, eq=False)
class MuSynthesis(Program):
    """The stabilising K with the least supremum over frequency of mixed mu.

    Mu is that of robust performance: its structure consists of the plant's perturbation and a full
    block that closes the performance channels. No method guarantees the global optimum, but the
    peak of every answer is certified.

    Parameters
    ----------
    plant
        Plant with a structure, performance outputs and exogenous inputs. Without a structure the
        peak is the H-infinity norm, which method "fixed" minimises over a family or order.
    structure
        Structure of the perturbation; None for that of the plant.
    start
        A stabilising controller to start from: a member of the family, if a family is given, or its
        parameters in the family. With None the method finds its own start.
    family
        Family of controllers for method "fixed", such as ``PID()`` or ``Decentralised(PI(),
        PI())``. None for all controllers; method "fixed" then searches those of the given order, or
        of the order of the start.
    random
        Number of stabilising members of the family, drawn at random around the start, from which
        method "fixed" also starts; the best result is the answer.
    target
        Certified peak that is low enough. Methods end when they reach it, and an answer with a
        higher peak is not valid. With None methods minimise the peak as far as they can.
    order
        Largest number of states of the controller.
    stable
        Whether the controller itself must be stable.
    fastest_pole
        Largest size of the controller's poles [rad/s].
    largest_gain
        Limit on the controller's own gain, which is its largest singular value at any frequency.
        The controller is then stable too.
    further_plants
        Further plants with the same controls and measurements, and with their own perturbations or
        none, for the same controller. The peak is the largest over all loops. An order, a family or
        a start must then be given.
    integral
        Whether the controller must have an exact integrator for each channel: its real poles
        nearest to zero are moved to zero before the peak is certified. The weight of the error
        should have a pole near zero, such as 1e-6 times the bandwidth. Only for continuous plants.
    units
        Units of exogenous inputs, measurements and controls by name, which figures show.

    If a method's controller does not meet these demands, method "fixed", which can meet them, is
    run instead. If no stable controller stabilises the plant, but a stable one is demanded, the
    answer is the proof of this (parity interlacing), with the outcome "infeasible". The same holds
    if a constant gain is demanded and none stabilises.

    Raises
    ------
    InputError
        The plant has no structure, performance or exogenous signals; it is sampled, but a family or
        a fastest pole is given; family or start do not fit, or the start does not stabilise; or the
        target is not positive and finite.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import MuSynthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> solution = wb.solve(MuSynthesis(plant, target=0.9), method="dk")
    >>> solution.certificate.holds, bool(solution.answer.upper <= 0.9)
    (True, True)
    """

    plant: GeneralisedPlant
    structure: Structure | None = None
    _: KW_ONLY
    start: StateSpace | None = None
    family: Family | None = None
    random: int = 0
    target: float | None = None
    order: int | None = field(default=None, kw_only=True)
    stable: bool = field(default=False, kw_only=True)
    fastest_pole: float | None = field(default=None, kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    integral: bool = field(default=False, kw_only=True)
    largest_gain: float | None = field(default=None, kw_only=True)
    further_plants: Sequence[GeneralisedPlant] = field(default=(), kw_only=True)

    default_method: ClassVar[str] = "dk"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.mu.dk",
        "workbench.synthesis.mu.multipliers.dgk",
        "workbench.synthesis.mu.structured.fixed",
    )
    headline: ClassVar[str] = "peak"

    def __post_init__(self) -> None:
        need_plant(self.plant)
        need_positive(self.target, "target", or_none=True)
        _ = self.demands  # raises InputError for a value that is not valid
        need_draws(self.random)
        need_continuous_plant(self)
        plant, structure = self.plant, self.structure or self.plant.structure
        fixed = any(each is not None for each in (self.family, self.order, self.start))
        if structure is None and not fixed:
            raise InputError(
                "the plant has no perturbation, so hinf solves this problem: give structure; or a "
                "family or an order, for the least norm that a controller of that form reaches"
            )
        plant = visible(replace(plant, structure=structure))
        if not (plant.performance and plant.exogenous):
            raise InputError(
                f"the plant has {plant.exogenous} exogenous inputs and {plant.performance} "
                "performance outputs; mu synthesis needs one of each at least"
            )
        shared, _ = tested(plant, asked_of(self))
        vars(self)["_given"], vars(self)["_shared"] = plant, shared
        plant = shared.plant
        object.__setattr__(self, "plant", plant)
        object.__setattr__(self, "structure", structure)
        object.__setattr__(self, "further_plants", further(self.further_plants, plant))
        need_form_for_all(self)
        need_all_stabilisable(self.further_plants)
        if self.family is not None:
            object.__setattr__(self, "family", family_for(self.family, plant))
        if self.only_fixed:
            object.__setattr__(self, "default_method", "fixed")
        if self.start is not None:
            object.__setattr__(self, "start", started(self.family, self.start, self.plants))

    @property
    def shared(self) -> Absorbed:
        """The plant that is closed by K, and the modes that the controller of the given plant also
        has.
        """
        found: Absorbed = vars(self)["_shared"]
        return found

    @property
    def only_fixed(self) -> bool:
        """Whether only method "fixed" can answer: for a family, without a perturbation, or for
        several plants.
        """
        return self.family is not None or self.structure is None or bool(self.further_plants)

    @property
    def plants(self) -> tuple[GeneralisedPlant, ...]:
        """The plants that the controller closes."""
        return (self.plant, *self.further_plants)

    def loop(self, controller: StateSpace) -> StateSpace:
        """The closed loops of all plants, as one block diagonal system."""
        return closed_side_by_side(self.plants, controller)

    @property
    def demands(self) -> Shippable:
        """The demands on the controller itself."""
        asked = self.order, self.stable, self.fastest_pole, self.integral
        return Shippable(*asked, gain=self.largest_gain)

    def claim_task(self, claim: Outcome) -> Task | None:
        if claim is not Outcome.INFEASIBLE or self.plant.system.dt:
            return None
        return no_controller(self.plant.controlled(), self.demands.stable)

    def without_demands(self) -> MuSynthesis:
        """The same synthesis without demands on the controller and without a start."""
        free: dict[str, Any] = {"order": None, "stable": False, "fastest_pole": None}
        free |= {"integral": False, "largest_gain": None, "further_plants": ()}
        return replace(self, start=None, family=None, random=0, **free)

    @cached_property
    def plane(self) -> MuSynthesis:
        """The same synthesis in continuous time, transformed by s = (2 / T) (z - 1) / (z + 1)."""
        given = self.plant
        system = bilinear_continuous(given.system)
        plant = replace(given, system=system, structure=self.structure)
        others = tuple(
            replace(one, system=bilinear_continuous(one.system)) for one in self.further_plants
        )
        start = None if self.start is None else bilinear_continuous(self.start)
        return replace(self, plant=plant, start=start, further_plants=others)

    def _respond_sampled(self, method: str | None, context: Context) -> Claim:
        """The answer found after the bilinear transformation, certified in sampled time."""
        answer, outcome, said = self.plane.respond(method, context)
        if answer is None:
            return None, Outcome.FAILED if outcome is Outcome.INFEASIBLE else outcome, said
        period = float(self.plant.system.dt)
        history = tuple(replace(one, K=bilinear_sampled(one.K, period)) for one in answer.history)
        found = self.answer(bilinear_sampled(answer.K, period), history=history)
        return found, outcome, said if found is not None else f"{said}; rounding made it unstable"

    def respond(self, method: str | None, context: Context) -> Claim:
        if self.plant.system.dt:
            return self._respond_sampled(method, context)
        zeros = violated(self.plant.controlled()) if self.demands.stable else None
        if zeros is not None:
            find_method(self, method)  # raises if it is unknown
            return None, Outcome.INFEASIBLE, words(self.plant.controlled(), *zeros)
        if self.only_fixed and (method or self.default_method) != "fixed":
            find_method(self, method)  # raises if it is unknown
            answer, outcome, said = super().respond("fixed", context)
            return answer, outcome, f"{method} cannot answer this: handed over to fixed: {said}"
        answer, outcome, said = super().respond(method, context)
        if answer is None or self.demands.admits(answer.K) or method == "fixed":
            return answer, outcome, said
        missed = "; ".join(c.name for c in self.demands.checks(answer.K) if not c.holds)
        answer, outcome, more = super().respond("fixed", context)
        return answer, outcome, f"{said}; not met: {missed}; handed over to fixed: {more}"

    @cached_property
    def closed_structure(self) -> Structure:
        """The perturbations and the performance blocks of all plants."""
        return joint_structure(self.plants)

    def certified_peak(
        self, controller: StateSpace, *, tolerance: float = PEAK_TOLERANCE
    ) -> Peak | None:
        """The certified peak of the loop; None if the loop is unstable."""
        if self.further_plants:
            loop = self.loop(controller)
            stable = stability_check(loop).holds
            return peak(loop, self.closed_structure, tolerance=tolerance) if stable else None
        return performance_peak(self.plant, controller, tolerance=tolerance)

    def answer(
        self,
        controller: StateSpace,
        *,
        history: tuple[Iterate, ...] = (),
        tolerance: float = PEAK_TOLERANCE,
    ) -> MuController | None:
        """The answer for K: K with balanced states, and its certified peak.

        None if the loop is unstable.
        """
        controller = self._with_balanced_states(controller)
        found = self.certified_peak(controller, tolerance=tolerance)
        return None if found is None else MuController.of(controller, found, history)

    def _with_balanced_states(self, K: StateSpace) -> StateSpace:
        """K with balanced states and the plant's names of signals.

        Without balancing, other tools compute responses with errors of 1e-3 for fifty badly scaled
        states.
        """
        if self.integral:
            K = with_integrator(K)
        return self.plant.named(realisation((*balanced(K.A, K.B, K.C), K.D), K.dt or 0.0))

    def scaled_answer(
        self, controller: StateSpace, scalings: ScalingFunctions, upper: float
    ) -> MuController | None:
        """The answer for K with the bound `upper` proven by scalings; None if they do not
        prove it.
        """
        controller = self._with_balanced_states(controller)
        loop = self.plant.close(controller)
        found = None
        if stability_check(loop).holds:
            found = scaled_peak(loop, self.closed_structure, scalings, upper)
        return None if found is None else MuController.of(controller, found, ())

    def answer_within_target(
        self, controller: StateSpace, peak: float, history: tuple[Iterate, ...]
    ) -> MuController | None:
        """The answer for a controller if its certified peak is at most the target; otherwise None.

        `peak` is the largest bound at some frequencies. Without a target the result is None. The
        tolerance of the certificate is as coarse as the distance from the target allows.
        """
        if self.target is None or peak > self.target:
            return None
        answer = self.answer(
            controller,
            history=history,
            tolerance=max((self.target / peak - 1.0) / 2, PEAK_TOLERANCE),
        )
        return answer if answer is not None and answer.upper <= self.target else None

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of states of the plant."""
        return float(self.plant.system.nstates)

    def objective(self, answer: MuController) -> float | None:
        """The proven peak of mu; None if a target is given, since any peak below it is as good."""
        return answer.upper if self.target is None else None

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: MuController, tolerance: float) -> list[Check]:
        K = answer.K
        fits = (K.noutputs, K.ninputs) == (self.plant.controls, self.plant.measurements)
        statement = "whether K has other outputs and inputs than controls and measurements"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        loop = self.loop(K)
        stability = stability_check(loop)
        found += [stability, *self.demands.checks(K), *([integral_check(K)] * self.integral)]
        if not stability.holds:
            return found
        proof = peak_checks(loop, self.closed_structure, answer.lower, answer.upper, answer.peak)
        if self.target is not None:
            statement = "proven supremum of mixed mu over the target, less 1"
            proof.append(Check("target", statement, answer.upper / self.target - 1, BOUND_ROUNDING))
        return [*found, *quantified_checks(EVERY_PERTURBATION, proof)]

    def second_opinion(self, answer: MuController) -> list[Check]:
        return [
            loops.powers_fall(self.loop(answer.K).A, self.plant.system.dt),
            *(
                max(of_all, key=lambda check: check.value)
                for of_all in zip(
                    *(self._second_opinion_on(answer, plant) for plant in self.plants), strict=True
                )
            ),
            *([self._whole_loop(answer)] if self.shared.copies else []),
        ]

    def _second_opinion_on(self, answer: MuController, plant: GeneralisedPlant) -> list[Check]:
        """Try the claimed peak with members of the set of one of the plants."""
        loop, claim = plant.close(answer.K), (plant.structure, answer.upper, answer.omega)
        return [
            loops.gain(plant.system, answer.K, *claim, poles=loop.poles()),
            *loops.in_time(loop, *claim),
        ]

    def _whole_loop(self, answer: MuController) -> Check:
        """Check the loop of the given plant and the whole controller; the certificate is about
        their parts.
        """
        given, whole = vars(self)["_given"], self._whole_controller(answer)
        loop = self.plant.close(answer.K)
        omega = between_poles(frequencies_of(loop), given, whole)
        value = relative_excess(float(loop_gains(given, whole, omega).max()), certified_norm(loop))
        statement = "largest response of the given plant with the whole controller over that of"
        over = f"at {omega.size} frequencies"
        limit = 2 * NORM_TOLERANCE
        return Check("whole", f"{statement} the loop certified, less 1", value, limit, over=over)

    def facts(self, answer: MuController) -> Sequence[str]:
        crossover = highest_crossover(self.plant.controlled(), answer.K)
        told = [
            f"controller: {in_words(self._whole_controller(answer))}, crossover {crossover:.4g} Hz"
        ]
        told += self._settings(answer.K)
        if self.shared.copies:
            told.append(self.shared.words)
        if answer.upper > 1.0:
            told.append(
                f"mu is not below 1 but {answer.upper:.4g}: what was asked for is not met for "
                "every plant of the set"
            )
        return [*told, *self.plant.tested]

    def _settings(self, K: StateSpace) -> list[str]:
        """The settings of a member of the family as engineers know them, in one line; "" without
        any.
        """
        try:
            found = {} if self.family is None else self.family.settings(in_continuous_plane(K))
        except InputError:  # roots that have become equal cannot be distinguished
            return []
        return (
            [", ".join(f"{name} = {value:.6g}" for name, value in found.items())] if found else []
        )

    def _whole_controller(self, answer: MuController) -> StateSpace:
        """The controller including the poles that it shares with weights."""
        return self.shared.whole(answer.K)

    def witnessed(self, answer: MuController) -> MuController:
        """The answer with the controller of the given plant, if K lacks shared poles."""
        if not self.shared.copies:
            return answer
        return replace(answer, whole=self.plant.named(self._whole_controller(answer)))

    def metrics(self, answer: MuController) -> dict[str, float]:
        whole = self._whole_controller(answer)
        return {
            "peak": answer.upper,
            "peak_lower": answer.lower,
            "order": float(whole.nstates),
            "iterations": float(len(answer.history)),
            "crossover_hz": highest_crossover(self.plant.controlled(), answer.K),
            "fastest_pole_rad_s": float(pole_sizes(whole).max(initial=0.0)),
            "stable_controller": float(stability_check(whole).holds),
        }

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: MuController) -> Dataset:
        import xarray as xr

        one = {"units": "1"}
        return xr.Dataset(
            {
                **stored_system("plant", self.plant.system),
                **stored_system("controller", answer.K),
                "peak": ("bound", [answer.lower, answer.upper], one | {"long_name": "mixed mu"}),
                "peak_omega": ((), answer.omega, {"units": "rad/s"}),
                **round_variables(answer.history),
                **({} if answer.peak is None else stored_peak("proven", answer.peak)),
            },
            coords={"bound": ["lower", "upper"]},
        )

    def from_dataset(self, data: Dataset) -> MuController:
        history = rounds_of(data)
        lower, upper = data["peak"].values.tolist()
        omega = float(data["peak_omega"])
        found = restored_peak(data, "proven")
        if found is not None:
            found = replace(found, lower=lower, upper=upper, omega=omega, complex_part=0.0)
        K = self.plant.named(restored_system(data, "controller"))
        return self.witnessed(MuController(K, lower, upper, omega, history=history, peak=found))

    @property
    def _gain_unit(self) -> str:
        """Unit of a scalar controller; empty if the unit of its input or output is not known."""
        system = self.plant.system
        u, y = self.units.get(system.input_labels[-1]), self.units.get(system.output_labels[-1])
        return "" if not (u and y) else "1" if u == y else f"{u}/{y}"

    def figures(self, answer: MuController) -> dict[str, Figure]:
        loop, loops = self.plant.close(answer.K), drawn_loops(self.plant, answer.K, self.units)
        found = {
            "mu": bounds_figure(loop, self.closed_structure, answer.upper),
            "controller": controller(self._whole_controller(answer), loop, self._gain_unit),
            "performance": performance_figure(loops, answer.upper),
            "steps": steps_figure(loops),
        }
        return found | (
            {"rounds": rounds_figure(answer.history, answer.upper)} if answer.history else {}
        )
