"""Polynomial models as methods of state-space fits: same records, validation and checks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench._core.arrays import BoolArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.impulse_responses import impulse_model
from workbench.identification.innovations.model import STATE_SAMPLES, InnovationsModel
from workbench.identification.innovations.pole_limits import CIRCLE_ROUNDING
from workbench.identification.innovations.prediction_error import (
    refinable,
    refine,
)
from workbench.identification.polynomials.regressions import arx_model
from workbench.identification.polynomials.regularised_arx import regularised_arx
from workbench.identification.polynomials.sparse_arx import sparse_arx
from workbench.identification.polynomials.structures import (
    PolynomialKind,
    polynomial_start,
    with_noise_of,
)
from workbench.identification.state_space.methods import (
    FitterOfOrder,
    SubspaceStarts,
    claim,
    identify,
)
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.question import Fitter
from workbench.identification.state_space.selection import best_fitting, least_of
from workbench.program import Claim, method
from workbench.solvers import Outcome

MOST_STATES = 60
"""Most states of a structured model: Box-Jenkins has at least n for each pair of channels."""
CONVERGED = 0.01
"""Gain in log likelihood below which a search ends.

Steps that gain 1 are far from the end where the criterion is flat, and estimates then scatter by
where each search stopped.
"""


@method(StateSpaceFit, "arx", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _arx(program: StateSpaceFit, context: Context) -> Claim:
    """ARX by least squares; polynomial matrices for several outputs."""
    way = arx_fits(program)
    return claim(identify(program, way, way, context))


def _refuses_knowledge(program: StateSpaceFit) -> str | None:
    if program.known is None:
        return None
    return "known poles and gains do not fit its kernels, of responses with poles at 0 alone"


@method(
    StateSpaceFit,
    "impulse-response",
    optimal=False,
    unfit=_refuses_knowledge,
    accuracy=ANY_ACCURACY_ALIKE,
)
def _impulse_response(program: StateSpaceFit, context: Context) -> Claim:
    """Impulse responses regularised by a decaying kernel, tuned by marginal likelihood."""
    way = impulse_response_fits(program)
    return claim(identify(program, way, way, context))


def refusal(program: StateSpaceFit, kind: PolynomialKind) -> str | None:
    """The reason why a kind of model cannot have the known poles; None if it can."""
    if program.known is None:
        return None
    nu, ny = program.record.u.shape[1], program.record.y.shape[1]
    several = ny if kind == "armax" else nu * ny
    repeated = [pole for pole, times in program.known.groups() if times > 1]
    if several > 1 and repeated:
        return (
            f"each of its {several} polynomials would have the repeated pole {repeated[0]:.6g} as "
            "often as the whole plant"
        )
    if kind == "armax":
        return None
    poles = program.known.poles
    # Its noise does not enter the plant's states.
    outside = [pole for pole in poles if abs(pole) >= 1 - CIRCLE_ROUNDING]
    if not outside:
        return None
    return (
        f"its predictor has the poles of the plant, and the known one {outside[0]:.6g} is not "
        "inside the unit circle"
    )


@method(
    StateSpaceFit,
    "armax",
    optimal=False,
    unfit=lambda program: refusal(program, "armax"),
    accuracy=ANY_ACCURACY_ALIKE,
)
def _armax(program: StateSpaceFit, context: Context) -> Claim:
    """ARMAX for each output, prediction errors minimised from the subspace model."""
    return _structured_answer(program, context, "armax")


@method(
    StateSpaceFit,
    "output-error",
    optimal=False,
    unfit=lambda program: refusal(program, "output-error"),
    accuracy=ANY_ACCURACY_ALIKE,
)
def _output_error(program: StateSpaceFit, context: Context) -> Claim:
    """Output error for each pair of channels, minimised from the subspace model."""
    return _structured_answer(program, context, "output-error")


@method(
    StateSpaceFit,
    "box-jenkins",
    optimal=False,
    unfit=lambda program: refusal(program, "box-jenkins"),
    accuracy=ANY_ACCURACY_ALIKE,
)
def _box_jenkins(program: StateSpaceFit, context: Context) -> Claim:
    """Box-Jenkins for each pair of channels, minimised from the subspace model."""
    return _structured_answer(program, context, "box-jenkins")


def _structured_answer(program: StateSpaceFit, context: Context, kind: PolynomialKind) -> Claim:
    starts = SubspaceStarts(program)
    way = structured_fits(program, kind, starts)
    answer = identify(program, way, way, context)
    if answer is None and kind != "armax":
        radii = [
            m.radius for n in program.orders or () for m in starts.of(program.estimation_record, n)
        ]
        largest = max(radii, default=0.0)
        if largest >= 1 - CIRCLE_ROUNDING:
            return None, Outcome.FAILED, (
                "its predictor has the poles of the plant, and the record shows one of modulus "
                f"{largest:.6g}, not inside the unit circle: take method prediction-error or armax"
            )  # fmt: skip
    return claim(answer)


def arx_fits(program: StateSpaceFit, apart: bool = False) -> FitterOfOrder:
    """Fitting functions for ARX models of an order; for ``apart`` see `arx`."""
    return _with_allowed_poles(
        program,
        lambda record, order: arx_model(
            record, order, direct=program.direct, delay=program.delays_samples, apart=apart
        ),
    )


def sparse_arx_fits(program: StateSpaceFit, apart: bool = False) -> FitterOfOrder:
    """Fitting functions for sparse ARX models with a longest lag; for ``apart`` see `arx`."""
    return _with_allowed_poles(
        program,
        lambda record, lags: sparse_arx(
            record, lags, direct=program.direct, delay=program.delays_samples, apart=apart
        ),
    )


def impulse_response_fits(program: StateSpaceFit) -> FitterOfOrder:
    """Fitting functions for impulse responses, the same for all orders."""
    found: dict[int, InnovationsModel | None] = {}

    def fit(record: Experiments, order: int) -> InnovationsModel | None:
        if id(record) not in found:
            found[id(record)] = impulse_model(
                record, direct=program.direct, delay=program.delays_samples
            )
        return found[id(record)]

    return _with_allowed_poles(program, fit)


def regularised_arx_fits(program: StateSpaceFit) -> FitterOfOrder:
    """Fitting functions for long regularised ARX models, the same for all orders.

    A model with a pole beyond the largest radius is dropped: it has too many states to move one
    pole.
    """
    found: dict[int, InnovationsModel | None] = {}

    def fit(record: Experiments) -> InnovationsModel | None:
        if id(record) not in found:
            model = regularised_arx(record, direct=program.direct, delay=program.delays_samples)
            usable = model is not None and model.radius <= program.largest_radius
            found[id(record)] = model if usable else None
        return found[id(record)]

    return lambda _: fit


def _with_allowed_poles(
    program: StateSpaceFit, fit: Callable[[Experiments, int], InnovationsModel | None]
) -> FitterOfOrder:
    """Fitting functions that drop models with poles where the program forbids them."""

    def way(order: int) -> Fitter:
        def checked(record: Experiments) -> InnovationsModel | None:
            return best_fitting(
                [fit(record, order)], record,
                direct=program.direct, largest_radius=program.largest_radius, known=program.known,
            )  # fmt: skip

        return checked

    return way


def structured_fits(
    program: StateSpaceFit, kind: PolynomialKind, starts: SubspaceStarts
) -> FitterOfOrder:
    """Functions that fit models of a kind, refined from the start with the least errors.

    Box-Jenkins starts at the output-error model, with an autoregression of its errors: noise that
    starts at the plant's poles does not leave them.
    """

    def way(order: int) -> Fitter:
        def refined(
            record: Experiments, start: InnovationsModel, entries: BoolArray
        ) -> InnovationsModel:
            return refine(
                start, record, 0.0,
                direct=program.direct, largest_radius=program.largest_radius, entries=entries,
                known=program.known, least_gain=CONVERGED,
            )[0]  # fmt: skip

        def fit(record: Experiments) -> InnovationsModel | None:
            def value(model: InnovationsModel) -> float:
                criterion = Criterion(model, record, 0.0, program.direct)
                return criterion(criterion.start(model))

            kept = len(program.known.poles) if program.known else 0
            plain: PolynomialKind = "output-error" if kind == "box-jenkins" else kind
            models = starts.of(record, order)
            begun = [polynomial_start(model, plain, kept) for model in models]
            usable = [
                model
                for model, _ in begun
                if model.order <= MOST_STATES and refinable(model, program.largest_radius)
            ]
            start = least_of(usable, value)
            if start is None:
                return None
            found = refined(record, start, begun[0][1])
            if kind != "box-jenkins":
                return found
            errors = [y - found.free_run(u, y, STATE_SAMPLES) for u, y in record.pieces()]
            noisy = with_noise_of(found, order, np.vstack(errors))
            if noisy.order > MOST_STATES or not refinable(noisy, program.largest_radius):
                return None
            return refined(record, noisy, polynomial_start(models[0], kind, kept)[1])

        return fit

    return way
