"""H-infinity synthesis as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_FREQUENCY, Check, relative_excess
from workbench.certify.norms import NORM_TOLERANCE, certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.second_opinion import loops
from workbench.synthesis.families.family import asked_of
from workbench.synthesis.families.synthesis import ControllerSynthesis
from workbench.synthesis.h_infinity import figures as drawn
from workbench.synthesis.h_infinity.assumptions import need_all_stabilisable
from workbench.synthesis.h_infinity.normalised import Scaled
from workbench.synthesis.h_infinity.singular_plants.absorbed import (
    Absorbed,
    between_poles,
    loop_gains,
    tested,
)
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.hidden_states import visible
from workbench.systems.margins import highest_crossover
from workbench.systems.realisation import in_words, pole_sizes
from workbench.systems.storage import restored_system, stored_system

LEAST_GAMMA = 1e-100
"""Least level that may be given. The squares of lower levels underflow to 0."""
CLAIM_TOLERANCE = 2.0 * NORM_TOLERANCE
"""Share by which the norm of a loop may exceed the claimed one."""


@dataclass(frozen=True, eq=False, repr=False)
class HinfController(drawn.DrawnController):
    """A controller u = K y with positive feedback, and the norm of its loop.

    Unlike a `StateSpace`, it has the proven norm of its loop.

    ``gamma`` is the level for which K was designed; ``norm`` is at most gamma. ``least`` is a level
    below which the method found no controller. It is NaN if a level was given, or if no such level
    is known because the plant had to be perturbed. If the controller shares poles with weights, K
    is the part without these poles, and ``whole`` or ``lti`` is the controller of the given plant.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import MixedSensitivity
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> program = MixedSensitivity(G, W_S=control.tf([0.5, 1.0], [1.0, 0.01]), W_KS=0.1)
    >>> answer = wb.solve(program).answer
    >>> answer.K.nstates, bool(answer.least <= answer.norm <= answer.gamma)
    (2, True)
    """

    K: StateSpace
    norm: float
    gamma: float
    _: KW_ONLY
    least: float = math.nan
    whole: StateSpace | None = None
    """The controller of the user's plant if K is only a part of it; otherwise None."""
    reached: tuple[float, ...] = field(default=(), kw_only=True)
    """Norms at which the descents of a local search ended, one for each start, in increasing
    order.
    """
    slope: float = field(default=math.nan, kw_only=True)
    """Remaining relative slope of the norm by the parameters: length of the shortest vector in the
    convex hull of gradients nearby. It is small at a stationary point, which is in general a local
    minimum.
    """

    @property
    def lti(self) -> StateSpace:
        """The controller of the user's plant."""
        return self.whole or self.K

    def summary(self) -> str:
        least = "" if math.isnan(self.least) else f", none found below {self.least:.6g}"
        return f"HinfController: {in_words(self.lti)}\n  norm {self.norm:.6g}{least}"


@dataclass(frozen=True, eq=False)
class HinfSynthesis(ControllerSynthesis):
    """The stabilising K with the least norm of F_l(P, K), or with a norm below a level.

    Parameters
    ----------
    plant
        Generalised plant. Perturbation channels, if there are any, count as exogenous inputs and
        performance outputs. Hidden unstable states are removed if they are copies of other states,
        which happens when a system occurs twice in a connection. If D12 or D21 lacks rank, or there
        are zeros on the stability boundary, methods perturb the plant a little; the certificate
        holds for the given plant. Modes on the boundary that no measurement shows, such as those of
        an integrating weight, are cancelled by poles of the controller (`HinfController.whole`) if
        a measurement drives them; the certificate then holds for the loop without them.
    gamma
        The level; None for the least level. Methods keep a relative distance of 1e-3 above the
        least level, since controllers at the least level have poles at infinity.
    order
        Largest number of states of the controller.
    family
        Family of controllers to search, such as ``PID()`` or ``Decentralised(PI(), PI())``.
    stable, fastest_pole
        Whether the controller itself must be stable, and the largest size of its poles [rad/s].
    start
        A stabilising controller to start from: a member of the family, if a family is given, or its
        parameters in the family. It may have fewer states than the order. With None the method
        finds its own start.
    random
        Number of further starts: stabilising members drawn at random around the start.
    largest_gain
        Limit on the controller's own gain, which is its largest singular value at any frequency.
        The controller is then stable too.
    further_plants
        Further plants with the same controls and measurements, which the same controller must
        stabilise. The norm is the largest over all loops. An order, a family or a start must then
        be given.

    Method "fixed" finds a controller of an order or a family by a local search from several starts.
    ``least`` of the answer is the least level over all controllers, so no other controller can be
    better by more than the factor norm / least. If another method's controller does not meet the
    demands, method "fixed" is run instead.

    Raises
    ------
    InputError
        The plant is not stabilisable or not detectable by a mode that the controller cannot share
        with a weight, is not finite or lacks signals; gamma is not positive and finite; or a demand
        on the controller is not valid, does not fit, or leaves no room for poles of weights.

    References
    ----------
    Zhou, Doyle, Glover, Robust and Optimal Control (1996), chapter 17.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import HinfSynthesis
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, -1.0])
    >>> plant = generalised_plant(
    ...     [(G, "v", "x")],
    ...     {"v": "u + d", "y": "x + n"},
    ...     exogenous=["d", "n"],
    ...     performance=["x", "u"],
    ...     control="u",
    ...     measurement="y",
    ... )
    >>> solution = wb.solve(HinfSynthesis(plant))
    >>> solution.certificate.holds, round(solution.answer.least, 2)
    (True, 2.73)
    >>> solution = wb.solve(HinfSynthesis(plant, order=0))  # a gain
    >>> solution.certificate.holds, round(solution.answer.norm, 2)
    (True, 2.73)
    """

    _: KW_ONLY
    gamma: float | None = None

    default_method: ClassVar[str] = "riccati"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.h_infinity.methods",
        "workbench.synthesis.h_infinity.conic",
        "workbench.synthesis.mu.structured.least_norm",
        "workbench.synthesis.mu.structured.norm_methods",
    )
    headline: ClassVar[str] = "norm"

    def __post_init__(self) -> None:
        need_plant(self.plant)
        need_positive(self.gamma, "gamma", or_none=True)
        if self.gamma is not None and self.gamma < LEAST_GAMMA:
            raise InputError(
                f"gamma is {self.gamma!r}; levels below {LEAST_GAMMA} cannot be told from 0"
            )
        object.__setattr__(self, "plant", visible(self.plant))
        _ = self._regular_and_scaled  # raises HiddenModeError for hidden modes
        self._set_form()
        need_all_stabilisable(self.further_plants)

    @cached_property
    def _regular_and_scaled(self) -> tuple[Absorbed, Scaled | None]:
        """The plant without modes that the controller shares, and this plant scaled, if it is
        regular.
        """
        return tested(self.plant, asked_of(self))

    @property
    def absorbed(self) -> Absorbed:
        """The plant that is closed by K: the given one without modes that the controller shares."""
        return self._regular_and_scaled[0]

    @property
    def closed_plant(self) -> GeneralisedPlant:
        return self.absorbed.plant

    @property
    def scaled(self) -> Scaled | None:
        """The scaled continuous-time plant that methods use; None if the plant must be
        perturbed.
        """
        return self._regular_and_scaled[1]

    # --- objective ----------------------------------------------------------------------------

    def objective(self, answer: HinfController) -> float | None:
        """The norm of the closed loop; None if a level is given, since any norm below it is as
        good.
        """
        return answer.norm if self.gamma is None else None

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: HinfController, tolerance: float) -> list[Check]:
        K = answer.K
        plant = self.absorbed.plant
        needed = (plant.controls, plant.measurements)
        fits = (K.noutputs, K.ninputs) == needed
        found = [
            Check(
                "dimensions",
                "whether K has other outputs and inputs than controls and measurements",
                float(not fits),
                0.0,
            )
        ]
        if not fits:
            return found
        loop = self.loop(K)
        stability = stability_check(loop)
        found += [stability, *self.demands.checks(K)]
        size = certified_norm(loop) if stability.holds else np.inf
        limit = CLAIM_TOLERANCE
        found.append(
            Check(
                "norm",
                "certified norm of the loop over the claimed one, less 1",
                relative_excess(size, answer.norm),
                limit,
                over=EVERY_FREQUENCY,
                proven=True,
            )
        )
        level = answer.gamma if self.gamma is None else self.gamma
        statement = "norm of the loop over gamma, less 1"
        beyond = relative_excess(size, level)
        found.append(Check("level", statement, beyond, limit, over=EVERY_FREQUENCY, proven=True))
        if not math.isnan(answer.least):
            statement = "level without a controller over the norm that this one has, less 1"
            value = relative_excess(answer.least, size)
            found.append(Check("least", statement, value, limit, over=EVERY_FREQUENCY))
        return found

    def second_opinion(self, answer: HinfController) -> list[Check]:
        K, loop = answer.K, self.loop(answer.K)
        claimed, proven = (
            (1 + CLAIM_TOLERANCE) * norm for norm in (answer.norm, certified_norm(loop))
        )
        each = (
            loops.gain(plant.system, K, None, claimed, poles=plant.close(K).poles())
            for plant in self.plants
        )
        sampled = max(each, key=lambda check: check.value)
        over_proven = (
            relative_excess((sampled.value + 1.0) * claimed, proven) if claimed else sampled.value
        )
        return [
            loops.powers_fall(loop.A, loop.dt),
            sampled,
            replace(sampled, name="sampled plants under the certified norm", value=over_proven),
            *loops.in_time(loop, None, claimed),
            *([self._shared_poles_check(answer)] if self.absorbed.copies else []),
        ]

    def _shared_poles_check(self, answer: HinfController) -> Check:
        """Check the loop of the given plant and the whole controller; the certificate is about
        their parts.
        """
        omega = drawn.grid(self.absorbed.plant.close(answer.K))
        omega = between_poles(omega, self.plant, answer.lti)
        size = loop_gains(self.plant, answer.lti, omega)
        statement = "largest response of the given plant with the whole controller over the norm"
        value = relative_excess(float(size.max()), answer.norm)
        over = f"at {omega.size} frequencies"
        return Check("whole", f"{statement}, less 1", value, CLAIM_TOLERANCE, over=over)

    def facts(self, answer: HinfController) -> Sequence[str]:
        crossover = highest_crossover(self.absorbed.plant.controlled(), answer.K)
        said = [
            f"controller: {in_words(self._whole_controller(answer))}, crossover {crossover:.4g} Hz"
        ]
        if self.absorbed.copies:
            said.append(self.absorbed.words)
        if asked_of(self) and answer.least > 0:
            said.append(
                f"norm {answer.norm:.4g} reached; no controller of any order was found below "
                f"{answer.least:.4g}: distance {answer.norm / answer.least - 1:.1%}"
            )
        if len(answer.reached) > 1:
            said.append(
                f"{len(answer.reached)} starts reached {answer.reached[0]:.4g} to "
                f"{answer.reached[-1]:.4g}"
            )
        if not math.isnan(answer.slope):
            said.append(
                f"relative slope that remains: {answer.slope:.2g}, 0 at a stationary point, which "
                "is a local one"
            )
        return [*said, *self.plant.tested]

    def metrics(self, answer: HinfController) -> dict[str, float]:
        whole = self._whole_controller(answer)
        return {
            "norm": answer.norm,
            "gamma": answer.gamma,
            "order": float(whole.nstates),
            "crossover_hz": highest_crossover(self.absorbed.plant.controlled(), answer.K),
            "fastest_pole_rad_s": float(pole_sizes(whole).max(initial=0.0)),
            "stable_controller": float(stability_check(whole).holds),
        }

    def _whole_controller(self, answer: HinfController) -> StateSpace:
        """The controller including the poles that it shares with weights."""
        return self.absorbed.whole(answer.K)

    def witnessed(self, answer: HinfController) -> HinfController:
        """The answer with the controller of the given plant, if K lacks shared poles."""
        if not self.absorbed.copies:
            return answer
        return replace(answer, whole=self.plant.named(self._whole_controller(answer)))

    # --- datasets and figures -----------------------------------------------------------------

    def figures(self, answer: HinfController) -> dict[str, Figure]:
        closed = self.absorbed.plant.close(answer.K)
        return {
            "loop": drawn.loop(closed, answer.gamma),
            "controller": drawn.controller(self._whole_controller(answer), closed),
        }

    def to_dataset(self, answer: HinfController) -> Dataset:
        import xarray as xr

        units = {"units": "1"}
        return xr.Dataset(
            {
                **stored_system("plant", self.plant.system),
                **stored_system("controller", answer.K),
                "norm": ((), answer.norm, units | {"long_name": "norm of the closed loop"}),
                "gamma": ((), answer.gamma, units | {"long_name": "level of the controller"}),
                "least": ((), answer.least, units | {"long_name": "no lower level was found"}),
                **self._stored_search(answer),
            }
        )

    @staticmethod
    def _stored_search(answer: HinfController) -> dict[str, Any]:
        """Data of a local search to be stored; empty for other answers."""
        if not answer.reached:
            return {}
        units = {"units": "1"}
        return {
            "reached": ("start", np.array(answer.reached), units),
            "slope": ((), answer.slope, units | {"long_name": "relative slope that remains"}),
        }

    def from_dataset(self, data: Dataset) -> HinfController:
        norm, gamma, least = (float(data[name]) for name in ("norm", "gamma", "least"))
        K = self.absorbed.plant.named(restored_system(data, "controller"))
        reached = tuple(map(float, data["reached"].values)) if "reached" in data else ()
        slope = float(data["slope"]) if "slope" in data else math.nan
        return self.witnessed(
            HinfController(K, norm, gamma, least=least, reached=reached, slope=slope)
        )
