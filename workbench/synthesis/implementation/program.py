"""Implementation of a controller on a processor, as a Program.

The controller is reduced, discretised and rounded to a number format. Then the sampled loop is
certified, including the hold, the computation delay and the anti-aliasing filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, get_args

import numpy as np

from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, relative_excess
from workbench.certify.norms import certified_norm
from workbench.certify.sampled_sets import SetPeak
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import as_list, need_choice, need_positive, need_whole
from workbench.program import Program
from workbench.second_opinion import loops
from workbench.second_opinion.implemented.c_header import (
    absolute_signals_agree,
    code_agrees,
    integer_code_agrees,
    setpoint_filter_agrees,
)
from workbench.second_opinion.implemented.integer_cascades import reached_rounding, reached_signals
from workbench.second_opinion.implemented.sampled_plants import (
    rounded_signals,
    sampled_plants,
    sampled_sensitivity,
)
from workbench.synthesis.implementation import implementation_figures as drawn
from workbench.synthesis.implementation import rounding
from workbench.synthesis.implementation.approximation import approximate
from workbench.synthesis.implementation.board_loop import BoardLoop
from workbench.synthesis.implementation.discretise import ImplementationMethod, discretise
from workbench.synthesis.implementation.fixed_point import FixedPoint, fixed_point, need_bits
from workbench.synthesis.implementation.implementation_checks import (
    follows,
    integers_agree,
    margins_agree,
)
from workbench.synthesis.implementation.implemented import (
    FixedFormat,
    ImplementedController,
    Precision,
)
from workbench.synthesis.implementation.sampled_loop import (
    need_delay,
    sampled_conditions,
    what_stabilises,
)
from workbench.synthesis.implementation.second_order import Sections, second_order_sections
from workbench.synthesis.implementation.working_point.actuator import Actuator, Limits, actuator
from workbench.synthesis.implementation.working_point.constant_signals import (
    ConstantSignals,
    constant_signals,
)
from workbench.synthesis.implementation.working_point.point import WorkingPoint
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import in_words, pole_sizes, realisation
from workbench.systems.storage import restored_system, stored_system

CLAIM_TOLERANCE = 1e-6
"""Relative difference from a claimed bound that counts as rounding."""
SAMPLED_SET = "for every plant of the set, sampled, up to half the sampling rate"


@dataclass(frozen=True, eq=False)
class Implementation(Program):
    """The sampled controller, in a number format, with the least peak of the sampled loop.

    The peak is that of mu of robust stability for the set of plants of an `UncertaintyModel`, and
    otherwise that of the sensitivity.

    Parameters
    ----------
    controller
        The controller: continuous, or sampled with `dt`, which is then used as it is.
    plant
        A plant from u to y, an `UncertaintyModel`, or a `GeneralisedPlant`; see
        `sampled_conditions` for the sign of the loop. For a model, the deviations W delta are taken
        as deviations of the sampled nominal, so their aliasing is neglected.
    dt
        Sampling time [s].
    delay_samples
        Computation delay [samples]; it may be fractional.
    precision
        ``"double"``, ``"float"`` or ``"fixed"``.
    order
        Number of states to which K is reduced first; None for no reduction.
    anti_aliasing
        Continuous filter of the measurements, with one channel or with a channel for each
        measurement.
    limits
        Lowest and highest values of the controls, absolute. The code enforces them, with
        anti-windup. In fixed point the full scales of the controls act in the same way.
    rate_limit
        Largest change of the controls in a second, which the code enforces in the same way.
    working_point
        The constant signals around which the plant is linear. The code then has absolute
        set-points, measurements and controls in the user's units. Not for a `GeneralisedPlant`,
        whose measurements may have any meaning.
    setpoint_filter
        Time constant [s] of a filter 1 / (T s + 1) of the set-points, sampled, or one for each
        set-point. It begins at the measurements and is outside the loop, so every certificate of
        the loop holds with it as without. `setpoint_time_constant` finds one for an overshoot. With
        a working point only.
    bits, signal_bits
        Bits of coefficients and of signals in fixed point, including signs.
    full_scale
        Full scales of the measurements and of the controls; for "fixed" only.
    sign
        As in `sampled_conditions`.

    Raises
    ------
    InputError
        Something does not fit; the message says what.

    Examples
    --------
    >>> import control
    >>> import workbench as wb
    >>> from workbench.synthesis import Implementation
    >>> K, G = control.tf([10.0], [1.0], 0.1), control.tf([1.0], [1.0, 1.0])
    >>> solution = wb.solve(Implementation(G, K, dt=0.1, precision="float"))
    >>> solution.certificate.holds, solution.answer.K.dt
    (True, 0.1)
    """

    plant: Any
    controller: Any  # a StateSpace after construction
    dt: float
    _: KW_ONLY
    delay_samples: float = 0.0
    precision: Precision = "double"
    order: int | None = field(default=None, kw_only=True)
    anti_aliasing: Any = field(default=None, kw_only=True)
    limits: Limits | None = field(default=None, kw_only=True)
    bits: int = field(default=24, kw_only=True)
    signal_bits: int = field(default=32, kw_only=True)
    full_scale: tuple[float, float] | None = field(default=None, kw_only=True)
    sign: int | None = field(default=None, kw_only=True)
    rate_limit: Any = field(default=None, kw_only=True)
    working_point: WorkingPoint | None = field(default=None, kw_only=True)
    setpoint_filter: Any = field(default=None, kw_only=True)

    default_method: ClassVar[str] = "best"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.implementation.implementation_methods",
    )
    headline: ClassVar[str] = "peak"

    def __post_init__(self) -> None:
        need_positive(self.dt, "dt")
        need_delay(self.delay_samples)
        need_choice(self.precision, Precision, "precision")
        fixed = self.precision == "fixed"
        if fixed and self.full_scale is None:
            raise InputError(
                "fixed point needs full_scale=(scales of measurements, scales of controls)"
            )
        if not fixed and self.full_scale is not None:
            raise InputError(f"full_scale belongs to fixed point, not to {self.precision!r}")
        if self.full_scale is not None:
            scales = as_list(self.full_scale, "full_scale")
            if len(scales) != 2:
                raise InputError(f"full_scale is {scales}; one of y and one of u are needed")
            for scale, name in zip(scales, ("measurements", "controls"), strict=True):
                need_positive(scale, f"full scale of {name}")
            for name in ("bits", "signal_bits"):
                need_bits(getattr(self, name), name)
        K = as_system(self.controller, "controller")
        if K.dt and (K.dt is True or abs(K.dt / self.dt - 1) > CLAIM_TOLERANCE):
            raise InputError(
                f"controller has dt = {K.dt}; give a continuous controller, or one sampled every "
                f"{self.dt:g} s"
            )
        if self.order is not None:
            need_whole(self.order, "order")
            if not 0 <= self.order <= K.nstates:
                raise InputError(f"order is {self.order}; controller has {K.nstates} states")
            if K.dt:
                raise InputError("a sampled controller is not reduced: give the continuous one")
        if self.working_point is not None and isinstance(self.plant, GeneralisedPlant):
            raise InputError(
                "a working point needs a plant from u to y, or a model of it: what a generalised "
                "plant measures may be anything"
            )
        object.__setattr__(self, "controller", K)
        _ = self.actuator  # raises InputError for wrong limits
        _ = self.loop.loop_of(
            realisation((K.A, K.B, K.C, K.D), self.dt)
        )  # raises InputError for parts that do not fit together

    @cached_property
    def loop(self) -> BoardLoop:
        """The loop around the controller."""
        return BoardLoop(self.plant, self.dt, self.delay_samples, self.anti_aliasing, self.sign)

    @cached_property
    def actuator(self) -> Actuator | None:
        """The limits of the controls, the working point, and the filter of the set-points."""
        sizes, sign = (self.controller.ninputs, self.controller.noutputs), self.loop.nominal[1]
        return actuator(
            self.limits,
            self.rate_limit,
            self.working_point,
            sizes,
            self.dt,
            sign,
            self.setpoint_filter,
        )

    # --- answers ----------------------------------------------------------------------------------

    @cached_property
    def reduced(self) -> StateSpace:
        """The controller with at most `order` states."""
        if self.order is None or self.order == self.controller.nstates:
            return self.controller
        if isinstance(self.plant, GeneralisedPlant):
            return approximate(self.controller, self.order, method="weighted", plant=self.plant)
        return approximate(self.controller, self.order, method="balanced")

    def implemented(self, way: ImplementationMethod) -> ImplementedController:
        """The controller from `coefficients` with the bounds of its loop.

        Raises InputError if the loop is unstable.
        """
        return self._with_bounds(self.coefficients(way))

    def coefficients(self, way: ImplementationMethod) -> ImplementedController:
        """The controller, discretised by one method, with the coefficients of the number format."""
        K = self.reduced
        prewarp = None
        if K.dt:
            sampled, way_said = K, "given sampled"
        else:
            sampled = discretise(K, self.dt, method=way, prewarp=prewarp)
            way_said = way
        sampled = _named_as(sampled, self.controller, self.dt)
        if self.precision == "fixed":
            return self._fixed_point_controller(
                second_order_sections(self._in_full_scales(sampled)), way_said
            )
        kind = np.float32 if self.precision == "float" else np.float64
        with np.errstate(over="ignore"):
            A, B, C, D = (
                np.asarray(getattr(sampled, name)).astype(kind).astype(float) for name in "ABCD"
            )
        if not all(np.isfinite(part).all() for part in (A, B, C, D)):
            raise InputError(f"controller has numbers that {self.precision} cannot hold")
        coefficients = _named_as(realisation((A, B, C, D), self.dt), self.controller, self.dt)
        return self._unjudged(coefficients, way_said)

    def _unjudged(self, K: StateSpace, found: str) -> ImplementedController:
        none = rounding.Rounding(np.inf, np.inf)
        return ImplementedController(
            K, found, self.precision, np.inf, None, (), none, actuator=self.actuator
        )

    def _in_full_scales(self, K: StateSpace) -> StateSpace:
        """K with measurements and controls relative to their full scales."""
        assert self.full_scale is not None
        y, u = self.full_scale
        return realisation((K.A, K.B * y, K.C / u, K.D * (y / u)), self.dt)

    def _fixed_point_controller(self, sections: Sections, found: str) -> ImplementedController:
        """The controller as cascades in fixed point."""
        assert self.full_scale is not None
        made = fixed_point(sections, self.bits, self.signal_bits)
        y, u = self.full_scale
        own = made.quantised.system
        K = realisation((own.A, own.B / y, own.C * u, own.D * (u / y)), self.dt)
        form = FixedFormat(self.bits, self.signal_bits, y, u)
        bare = self._unjudged(_named_as(K, self.controller, self.dt), found)
        return replace(bare, fixed=made, format=form)

    def _with_bounds(self, made: ImplementedController) -> ImplementedController:
        """The controller with the bounds of its loop. Raises InputError if the loop is unstable."""
        K = made.K
        plant, sign = self.loop.nominal
        found = sampled_conditions(plant, K, self.dt, delay_samples=self.delay_samples, sign=sign)
        if not found.stable:
            advice = what_stabilises(plant, K, self.dt, self.delay_samples, sign)
            raise InputError(
                f"the sampled loop is unstable, its largest pole {found.pole:.6g}; {advice}"
            )
        return replace(
            made,
            sensitivity=certified_norm(self.loop.sensitivity(K)),
            peak=self.loop.peak(K),
            margins=found.margins,
            rounding=self.rounding_of(made),
        )

    def rounding_of(self, made: ImplementedController) -> rounding.Rounding:
        """Bounds on the rounding errors in the loop."""
        loop = self.loop.loop_of(made.K)
        G = loop.held()
        if made.fixed is None:
            unit = rounding.FLOAT_UNITS[self.precision]
            return rounding.floating_rounding(made.K, G, loop.sign, unit)
        assert self.full_scale is not None
        y, u = self.full_scale
        scaled = realisation((G.A, G.B * u, G.C / y, G.D * (u / y)), self.dt)
        return rounding.fixed_rounding(made.fixed, scaled, loop.sign, self.signal_bits)

    def objective(self, answer: ImplementedController) -> float:
        """Peak of mu of the sampled loop for the set of plants, or otherwise the peak of the
        sensitivity.
        """
        return answer.sensitivity if answer.peak is None else answer.peak.upper

    def constant_signals(self, answer: ImplementedController) -> ConstantSignals | None:
        """Effect of constant signals around the working point, if every plant is stabilised."""
        model, act, peak = self.loop.model, self.actuator, answer.peak
        if model is None or act is None or act.point is None or peak is None or peak.upper >= 1.0:
            return None
        return constant_signals(model, answer.K, self.loop.nominal[1], act)

    # --- checks -----------------------------------------------------------------------------------

    def checks(self, answer: ImplementedController, tolerance: float) -> Sequence[Check]:
        loop = self.loop.loop_of(answer.K)
        stability = stability_check(loop.closed())
        found = [self._given_controller_check(answer), replace(stability, name="sampled loop")]
        if not stability.holds:
            return found
        plant, sign = self.loop.nominal
        again = sampled_conditions(
            plant, answer.K, self.dt, delay_samples=self.delay_samples, sign=sign
        )
        found.append(margins_agree(answer.margins, again.margins))
        size = relative_excess(certified_norm(self.loop.sensitivity(answer.K)), answer.sensitivity)
        statement = "certified peak of the sensitivity over the claimed one, less 1"
        over = EVERY_FREQUENCY
        found.append(Check("sensitivity", statement, size, CLAIM_TOLERANCE, over=over, proven=True))
        if self.loop.model is not None:
            assert answer.peak is not None
            upper = self.loop.peak(answer.K)
            assert upper is not None
            value = max(
                relative_excess(upper.upper, answer.peak.upper),
                relative_excess(answer.peak.lower, upper.lower),
            )
            statement = "by which share a claimed bound of mu is better than the proven one"
            found.append(
                Check(
                    "sets of plants",
                    statement,
                    value,
                    CLAIM_TOLERANCE,
                    over=SAMPLED_SET,
                    proven=True,
                )
            )
        constant = self.constant_signals(answer)
        if constant is not None:
            found.append(constant.check())
        errors = self.rounding_of(answer)
        statement = "growth of rounding errors by one turn through the loop"
        every = "for every signal in the loop"
        found.append(Check("no limit cycle", statement, errors.contraction, 1.0, over=every))
        statement = "rounding errors of the control, or their growth, over the claimed, less 1"
        share = max(
            relative_excess(errors.share, answer.rounding.share),
            relative_excess(errors.contraction, answer.rounding.contraction),
        )
        found.append(Check("rounding", statement, share, CLAIM_TOLERANCE, over=every))
        if answer.fixed is not None:
            largest = max(
                float(one.largest.max(initial=0.0))
                for line in answer.fixed.cascades
                for one in line
            )
            statement = "largest signal of a section for measurements of full scale"
            over = "for every measurement within full scale"
            found.append(Check("no overflow", statement, largest, 1.0, over=over))
            found.append(integers_agree(answer.fixed))
        else:
            statement = "whether a coefficient is no number of the format"
            kind = np.float32 if self.precision == "float" else np.float64
            off = any(
                (np.asarray(part).astype(kind).astype(float) != np.asarray(part)).any()
                for part in (answer.K.A, answer.K.B, answer.K.C, answer.K.D)
            )
            found.append(Check("coefficients", statement, float(off), 0.0, over=THIS_SYSTEM))
        return found

    def _given_controller_check(self, answer: ImplementedController) -> Check:
        """Check that the controller is the given one, discretised by the method that it names."""
        for way in get_args(ImplementationMethod):
            if (
                self.controller.dt or answer.found == way
            ):  # for a sampled controller all methods are the same
                return follows(answer.K, self.coefficients(way).K, self.precision)
        statement = "whether nobody knows how it was discretised"
        return Check("controller", statement, 1.0, 0.0, over=THIS_SYSTEM)

    def second_opinion(self, answer: ImplementedController) -> Sequence[Check]:
        loop = self.loop.loop_of(answer.K)
        closed = loop.closed()
        found = [
            loops.powers_fall(closed.A, closed.dt),
            sampled_sensitivity(loop.held(), answer.K, loop.sign, answer.sensitivity),
        ]
        if self.loop.model is not None and answer.peak is not None:
            model = self.loop.model
            found.append(
                sampled_plants(
                    loop.held(),
                    answer.K,
                    loop.sign,
                    (model.W_c.response, None if model.W_r is None else model.W_r.response),
                    model.form,
                    answer.peak.upper,
                )
            )
        if answer.fixed is None:
            found.append(
                rounded_signals(
                    answer.K,
                    loop.held(),
                    loop.sign,
                    np.float32 if self.precision == "float" else np.float64,
                    answer.rounding.share,
                )
            )
            kind = np.float32 if self.precision == "float" else np.float64
            found.append(code_agrees(answer.code(), answer.K, kind))
            if self.actuator is not None:
                found.append(absolute_signals_agree(answer.code(), self._absolute(), kind))
        else:
            found += self._integer_checks(answer, answer.fixed, loop.held(), loop.sign)
        if self.setpoint_filter is not None:
            decays = np.exp(-self.dt / np.broadcast_to(self.setpoint_filter, answer.K.ninputs))
            found.append(setpoint_filter_agrees(answer.code(), decays))
        return found

    def _absolute(self) -> dict[str, Any]:
        """Data on absolute signals for the code, by the names of its tables."""
        point, found = self.working_point, dict.fromkeys(("lowest", "highest", "change", "rest"))
        rate = None if self.rate_limit is None else np.atleast_1d(self.rate_limit) * self.dt
        limits = (None, None) if self.limits is None else map(np.atleast_1d, self.limits)
        rest = None if point is None else point.u
        return dict(zip(found, (*limits, rate, rest), strict=True))

    def _integer_checks(
        self, answer: ImplementedController, fixed: FixedPoint, G: StateSpace, sign: int
    ) -> list[Check]:
        """Checks of the integers: by running their code, and with their worst-case inputs."""
        assert self.full_scale is not None
        y, u = self.full_scale
        scaled = realisation((G.A, G.B * u, G.C / y, G.D * (u / y)), self.dt)
        channels, step = fixed.quantised.channels, 2.0 ** (1 - self.signal_bits)
        shifts, largest = (
            [[getattr(one, name) for one in line] for line in fixed.cascades]
            for name in ("shifts", "largest")
        )
        return [
            *([integer_code_agrees(answer.code(), channels)] if self.signal_bits <= 32 else []),
            reached_rounding(channels, shifts, scaled, sign, step, answer.rounding.share),
            reached_signals(channels, shifts, largest, step),
        ]

    # --- results ----------------------------------------------------------------------------------

    def facts(self, answer: ImplementedController) -> Sequence[str]:
        told = [f"controller: {in_words(answer.K)}"]
        if answer.peak is not None and answer.peak.upper >= 1.0:
            told.append(
                f"mu of the sampled loop is not below 1 but {answer.peak.upper:.4g}: it is not "
                "proven stable for every plant of the set"
            )
        constant = self.constant_signals(answer)
        if constant is not None and self.working_point is not None:
            told.append(constant.words(self.working_point.y_unit))
        if self.setpoint_filter is not None:
            times = ", ".join(f"{one:.4g} s" for one in np.atleast_1d(self.setpoint_filter))
            told.append(
                f"set-points pass a filter of first order with {times}; it is outside the loop, so "
                "all that is proven of the loop holds with it as without"
            )
        return [*told, *getattr(self.plant, "tested", ())]

    def metrics(self, answer: ImplementedController) -> dict[str, float]:
        rows, constant = answer.margins, self.constant_signals(answer)
        return {
            "peak": self.objective(answer),
            "sensitivity_peak": answer.sensitivity,
            "gain_low": max(row.gain[0] for row in rows),
            "gain_high": min(row.gain[1] for row in rows),
            "phase_margin_deg": min(row.phase_deg for row in rows),
            "delay_margin_samples": min(row.delay_samples for row in rows),
            "rounding_share": answer.rounding.share,
            "order": float(answer.K.nstates),
            "fastest_pole_rad_s": float(pole_sizes(answer.K).max(initial=0.0)),
            "stable_controller": float((np.abs(answer.K.poles()) < 1.0).all()),
            "operations": float(answer.operations),
            "memory_bytes": float(answer.memory),
        } | ({} if constant is None else {"static_error": constant.error})

    def figures(self, answer: ImplementedController) -> dict[str, Figure]:
        model = self.loop.model
        around = None if model is None else (self.loop.around(answer.K), model.W_c, model.W_r)
        return drawn.figures_of(answer, self.loop.sensitivity(answer.K), around, self.controller)

    def tables(self, answer: ImplementedController) -> dict[str, str]:
        return {
            "margins": drawn.margins_table(answer),
            "code": f"```c\n{answer.code()}```\n",
        }

    def files(self, answer: ImplementedController) -> dict[str, str]:
        return {"controller.h": answer.code()}

    def to_dataset(self, answer: ImplementedController) -> Dataset:
        import xarray as xr

        unit = {"units": "1"}
        numbers = {
            "sensitivity": (answer.sensitivity, "certified peak of the sensitivity"),
            "rounding_share": (answer.rounding.share, "bound of rounding errors of the control"),
            "contraction": (answer.rounding.contraction, "growth of errors by a turn of the loop"),
        }
        if answer.peak is not None:
            numbers |= {
                "mu_lower": (answer.peak.lower, "lower bound of mu of the sampled loop"),
                "mu_upper": (answer.peak.upper, "upper bound of mu of the sampled loop"),
                "mu_omega": (answer.peak.omega, "angular frequency of the lower bound"),
            }
        variables: dict[str, Any] = {
            name: ((), value, unit | {"long_name": said}) for name, (value, said) in numbers.items()
        }
        variables |= stored_system("controller", answer.K)
        if answer.fixed is not None:
            variables["sections"] = drawn.padded_sections(self._sections(answer))
        variables["discretisation"] = ((), answer.found, {"long_name": "way of discretisation"})
        data = xr.Dataset(variables)
        return data.assign(drawn.stored_margins(answer.margins))

    def from_dataset(self, data: Dataset) -> ImplementedController:
        found = str(data["discretisation"].values)
        if self.precision == "fixed":
            made = self._fixed_point_controller(
                drawn.read_sections(data["sections"], self.dt), found
            )
        else:
            K = _named_as(restored_system(data, "controller"), self.controller, self.dt)
            made = self._unjudged(K, found)
        number = {
            name: float(data[name])
            for name in data
            if data[name].dtype.kind == "f" and not data[name].ndim
        }
        peak = None
        if "mu_upper" in number:
            peak = SetPeak(number["mu_lower"], number["mu_upper"], number["mu_omega"])
        return replace(
            made,
            sensitivity=number["sensitivity"],
            peak=peak,
            margins=drawn.read_margins(data),
            rounding=rounding.Rounding(number["rounding_share"], number["contraction"]),
        )

    def _sections(self, answer: ImplementedController) -> Sections:
        """The sections with the rounded coefficients; rounding does not change them again."""
        assert answer.fixed is not None
        return answer.fixed.quantised


def _named_as(K: StateSpace, like: StateSpace, period: float) -> StateSpace:
    return realisation(
        (K.A, K.B, K.C, K.D), period, inputs=like.input_labels, outputs=like.output_labels
    )
