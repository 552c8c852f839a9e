"""Continuous-time transfer functions by least squares, instrumental variables or output errors.

The model is y = B(s) / A(s) u + v with A(s) = s^n + a_(n-1) s^(n-1) + ... + a_0. Filtered by any
stable 1 / F(s) it is a linear regression,

    s^n / F y = phi' theta + error,   phi = (s^m / F u ... 1 / F u, -s^(n-1) / F y ... -1 / F y).

The regressors contain the output's noise, so least squares is biased: their error does not vanish
with more data. Instruments z, which are the same regressors of a noise-free output, are not
correlated with the noise, and the solution of sum z (error) = 0 is consistent whatever the colour
of the noise. The refined method computes them with the model of the last iteration and filters by
its denominator; in white noise it is then as accurate as any unbiased estimate can be (P. C. Young
and A. Jakeman, Int. J. Control 31, 1980; H. Garnier and L. Wang (eds.), Identification of
Continuous-time Models from Sampled Data, 2008, chapter 4). Output errors y - B / A u have the
gradient z: Gauss-Newton steps minimise their power, which is the prediction-error method of this
model structure, and maximum likelihood in white normal noise (L. Ljung, System Identification, 2nd
ed., 1999, chapter 7).

The covariances hold for noise of any colour: the spectrum of the errors is estimated and smoothed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import SolverError
from workbench.identification.transfer_functions.estimate import TransferFunctionEstimate
from workbench.identification.transfer_functions.filtered_record import (
    FilteredRecord,
    in_deviations,
    solved,
)
from workbench.identification.transfer_functions.filters import mirrored
from workbench.identification.transfer_functions.record import SampledRecord
from workbench.input_checks import need_kind

CHANGE_TOLERANCE = 1e-4
"""The iterations end when the coefficients change by less than this, in standard deviations."""
MOST_ITERATIONS = 100
LEAST_SHARE = 1e-6
"""Smallest fraction of a Gauss-Newton step that is tried."""


def filtered_least_squares(
    record: SampledRecord, degrees: tuple[int, int], denominator: ArrayLike
) -> TransferFunctionEstimate:
    """Least squares of the equation error, all signals filtered by 1 / F(s).

    Output noise biases it, the more the wider the filter is, and its covariance does not include
    the bias. It provides starts for the other methods.

    Parameters
    ----------
    degrees
        (m, n), degrees of numerator and denominator, m <= n.
    denominator
        F, descending powers (n + 1,), monic: a guess of A, or (s + bandwidth)^n.

    Raises
    ------
    InputError
        Other degrees, an unstable filter, or a record that does not determine the coefficients.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import SampledRecord, filtered_least_squares
    >>> time = np.arange(2000) * 0.05
    >>> u = np.sign(np.sin(time**1.3))
    >>> y = control.forced_response(control.tf([3.0], [1.0, 2.0]), time, u).outputs
    >>> record = SampledRecord(u, y, dt=1 / 20.0, hold="first-order")
    >>> found = filtered_least_squares(record, degrees=(0, 1), denominator=[1.0, 3.0])
    >>> np.r_[found.numerator, found.denominator].round(2).tolist()
    [3.0, 1.0, 2.0]
    """
    need_kind(record, SampledRecord, "record")
    model = FilteredRecord.of(record, degrees, denominator)
    phi, target = model.regressors()
    theta = solved(phi.T @ phi, phi.T @ target)
    return model.estimate(theta, (phi, phi), target - phi @ theta, 0)


def refined_instruments(
    record: SampledRecord, start: TransferFunctionEstimate
) -> TransferFunctionEstimate:
    """Simplified refined instrumental variables (SRIVC).

    Parameters
    ----------
    start
        A first model, as from `filtered_least_squares`; it also gives the degrees. Unstable poles
        are mirrored.

    Raises
    ------
    InputError
        The record does not determine the coefficients.
    SolverError
        The iterations do not converge: start from a better model, or lower the degrees.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import (
    ...     SampledRecord,
    ...     filtered_least_squares,
    ...     refined_instruments,
    ... )
    >>> time = np.arange(2000) * 0.05
    >>> u = np.sign(np.sin(time**1.3))
    >>> y = control.forced_response(control.tf([3.0], [1.0, 2.0]), time, u).outputs
    >>> record = SampledRecord(u, y, dt=1 / 20.0, hold="first-order")
    >>> start = filtered_least_squares(record, degrees=(0, 1), denominator=[1.0, 10.0])
    >>> refined_instruments(record, start).denominator.round(2).tolist()
    [1.0, 2.0]
    """
    need_kind(record, SampledRecord, "record")
    need_kind(start, TransferFunctionEstimate, "start")
    degrees = len(start.numerator) - 1, len(start.denominator) - 1
    values = np.append(start.numerator, mirrored(start.denominator)[1:])
    for done in range(1, MOST_ITERATIONS + 1):
        model = FilteredRecord.at(record, degrees, values)
        z, _ = model.instruments(values, record.clean_input)
        phi, target = model.regressors()
        cross = z.T @ phi
        theta = solved(cross, z.T @ target)
        error = target - phi @ theta
        change = in_deviations(theta - values / model.units, theta, cross, z, error)
        if change < CHANGE_TOLERANCE:
            return model.estimate(theta, (z, phi), error, done)
        values = theta * model.units
        values[-degrees[1] :] = mirrored(np.append(1.0, values[-degrees[1] :]))[1:]
    raise SolverError(
        f"the instruments do not settle in {MOST_ITERATIONS} iterations: the last one changed a "
        f"coefficient by {change:.2g} standard deviations"
    )


def output_error(
    record: SampledRecord, start: TransferFunctionEstimate
) -> TransferFunctionEstimate:
    """Least power of the output errors y - B / A u, by damped Gauss-Newton steps.

    The noise may have any colour, but must not reach the input by feedback.

    Parameters
    ----------
    start
        A first model, as for `refined_instruments`. The minimum near it is found.

    Raises
    ------
    InputError
        The record does not determine the coefficients.
    SolverError
        The steps do not end at a minimum.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import SampledRecord, filtered_least_squares, output_error
    >>> time = np.arange(2000) * 0.05
    >>> u = np.sign(np.sin(time**1.3))
    >>> y = control.forced_response(control.tf([3.0], [1.0, 2.0]), time, u).outputs
    >>> record = SampledRecord(u, y, dt=1 / 20.0, hold="first-order")
    >>> start = filtered_least_squares(record, degrees=(0, 1), denominator=[1.0, 10.0])
    >>> output_error(record, start).numerator.round(2).tolist()
    [3.0]
    """
    need_kind(record, SampledRecord, "record")
    need_kind(start, TransferFunctionEstimate, "start")
    degrees = len(start.numerator) - 1, len(start.denominator) - 1
    values = np.append(start.numerator, mirrored(start.denominator)[1:])
    model = FilteredRecord.at(record, degrees, values)
    z, output = model.instruments(values, record.u)
    for done in range(1, MOST_ITERATIONS + 1):
        error = record.y - output
        square = z.T @ z
        step = solved(square, z.T @ error)
        settled = in_deviations(step, values / model.units, square, z, error) < CHANGE_TOLERANCE
        share = 1.0
        while not settled:
            trial = values + share * step * model.units
            if np.roots(np.append(1.0, trial[-degrees[1] :])).real.max() < 0:
                after = FilteredRecord.at(record, degrees, trial)
                new_z, new_output = after.instruments(trial, record.u)
                if np.sum((record.y - new_output) ** 2) < error @ error:
                    break
            share /= 2
            settled = share < LEAST_SHARE  # further progress is hidden by rounding
        if settled:
            return model.estimate(values / model.units, (z, z), error, done)
        values, model, z, output = trial, after, new_z, new_output
    raise SolverError(
        f"the output error still falls after {MOST_ITERATIONS} steps: start from a better model"
    )
