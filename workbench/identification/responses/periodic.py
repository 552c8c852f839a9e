"""Frequency responses from periodic experiments, with regions that contain the true response.

Suppose that the M periods give circular complex normal samples of variance S^2 (real and imaginary
part together, equation 4.14). Their mean obeys

    |mean - truth|^2 / (S^2 / M)       ~ F(2, 2 M - 2)
    Re(mean - truth) / (S / sqrt(2 M)) ~ t(2 M - 2), and the same holds for the imaginary part.

Equation 4.15 of the thesis uses t(M - 1) and S for each part; at M = 10 it is 1.3 times as wide as
the disc and 1.6 times as wide as the interval of one part.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench import figures
from workbench._core.heavy_types import Dataset, Figure, FrequencyResponseData
from workbench.errors import InputError
from workbench.identification.experiments.quality import IdentificationWarning
from workbench.identification.record_tests.report import RecordReport
from workbench.identification.responses.assumptions import Assumptions, assess


@dataclass(frozen=True, eq=False)
class ResponseEstimate:
    """A measured frequency response with its variance.

    Unlike `FrequencyResponseData`, it has the variance of each entry.

    Parameters
    ----------
    frequency_hz
        Frequencies [Hz], shape (F,).
    response
        Complex, shape (F, outputs, inputs).
    variance
        E|error|^2 of each entry of the response, in the same shape.
    degrees
        Number of real degrees of freedom of the variance.
    report
        Report of the record, if there is one.
    dry_friction
        Size of the dry friction that was taken out of the input, in its unit; 0 if none was found.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate
    >>> measured = ResponseEstimate(
    ...     np.array([1.0]), np.full((1, 1, 1), 2.0 + 0j), np.full((1, 1, 1), 1e-4), 14.0
    ... )
    >>> measured.omega.round(
    ...     4).tolist(), bool(0.01 < measured.radius(confidence=0.95)[0, 0, 0] < 0.03
    ... )
    ([6.2832], True)
    """

    frequency_hz: np.ndarray
    response: np.ndarray
    variance: np.ndarray
    degrees: float
    report: RecordReport | None = field(default=None, kw_only=True, repr=False)
    dry_friction: float = field(default=0.0, kw_only=True)

    def __repr__(self) -> str:
        size = np.abs(self.response)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.nanmedian(np.sqrt(self.variance) / size)
        outputs, inputs = self.response.shape[1:]
        return (
            f"{type(self).__name__}: {outputs} outputs, {inputs} inputs, {self.frequency_hz.size} "
            f"frequencies from {self.frequency_hz.min():.4g} to {self.frequency_hz.max():.4g} Hz\n"
            f"  |response| from {size.min():.4g} to {size.max():.4g}, standard deviation "
            f"{100 * share:.2g} % of it in the median, {self.degrees:g} degrees of freedom"
        )

    def plot(self, *, confidence: float = 0.95) -> Figure:
        """Bode plot of all entries, each with a band for its magnitude."""
        _, outputs, inputs = self.response.shape
        named = {
            f"input {i + 1} to output {o + 1}": (o, i)
            for o in range(outputs)
            for i in range(inputs)
        }
        curves = {name: self.response[:, o, i] for name, (o, i) in named.items()}
        figure = figures.bode_plot(self.frequency_hz, curves, "1", many=f"{len(curves)} entries")
        top, radius = figure.axes[0], self.radius(confidence=confidence)
        for name, (o, i) in named.items():
            size, reach = np.abs(curves[name]), radius[:, o, i]
            low = np.maximum(size - reach, size / 100)  # a band down to 0 has no visible end
            top.fill_between(self.frequency_hz, low, size + reach, alpha=0.25, linewidth=0)
        top.set_title(f"with {100 * confidence:g} % bands")
        return figure

    @property
    def omega(self) -> np.ndarray:
        """Angular frequencies (F,) [rad/s]."""
        return 2 * np.pi * self.frequency_hz

    @property
    def frd(self) -> FrequencyResponseData:
        """The response as python-control's object, which has no place for the variance."""
        import control

        return control.frd(np.moveaxis(self.response, 0, -1), self.omega)

    def radius(self, *, confidence: float = 0.99) -> np.ndarray:
        """Radius of the disc in the complex plane that contains the true response.

        ``confidence`` is the probability that it does.
        """
        return self._radius(confidence)

    def _radius(self, confidence: float) -> np.ndarray:
        """As `radius`; overridden by estimates whose errors are not simply complex normal."""
        radius: np.ndarray = np.sqrt(stats.f.ppf(confidence, 2, self.degrees) * self.variance)
        return radius

    def half_width(self, *, confidence: float = 0.99) -> np.ndarray:
        """Half-width of the confidence interval of the real part, and of the imaginary part."""
        return self._half_width(confidence)

    def _half_width(self, confidence: float) -> np.ndarray:
        """As `half_width`; overridden like `_radius`."""
        deviations = stats.t.ppf((1 + confidence) / 2, self.degrees)
        half_width: np.ndarray = deviations * np.sqrt(self.variance / 2)
        return half_width

    def to_dataset(self) -> Dataset:
        """Labelled dataset of the response, its variance and its radius at 99 % confidence."""
        import xarray as xr

        dims = ("frequency", "output", "input")
        variables = {
            "response": (dims, self.response, {"units": "1", "long_name": "response"}),
            "variance": (dims, self.variance, {"units": "1", "long_name": "E|error|^2"}),
            "radius": (dims, self.radius(), {"units": "1", "long_name": "radius at 99 %"}),
        }
        unit = {"units": "Hz", "long_name": "frequency"}
        return xr.Dataset(
            variables,
            coords={"frequency": ("frequency", self.frequency_hz, unit)},
            attrs={"degrees": self.degrees},
        )


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicResponse(ResponseEstimate):
    """A response from averaged periods, with the noise of one period.

    Unlike a `ResponseEstimate` in general, it also has the covariances of input and output.

    Parameters
    ----------
    input_covariance, output_covariance, cross_covariance
        Covariances of the amplitudes of a single period, with shapes (F, inputs, inputs),
        (F, outputs, outputs) and (F, outputs, inputs); the last is E[y u^H].
    periods
        Number of periods averaged.
    assumptions
        Results of the tests on the noise.
    covariance
        Covariance E[error error^H] (F, outputs inputs, outputs inputs) of the entries of the
        response, row by row.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import periodic_response
    >>> rng = np.random.default_rng(0)
    >>> u = np.ones((2, 8)) + 1e-3 * rng.standard_normal((2, 8))
    >>> found = periodic_response([1.0, 2.0], u, 0.5 * u + 1e-3 * rng.standard_normal((2, 8)))
    >>> found.periods, bool(found.half_width(confidence=0.95).max() < 1e-2)
    (8, True)
    """

    input_covariance: np.ndarray
    output_covariance: np.ndarray
    cross_covariance: np.ndarray
    periods: int
    assumptions: Assumptions
    covariance: np.ndarray


def periodic_response(
    frequency_hz: ArrayLike, u: ArrayLike, y: ArrayLike, *, transients: int = 0
) -> PeriodicResponse:
    """Errors-in-variables response from the amplitudes of repeated periods (equations 4.9-4.15).

    The estimate G = Y U^-1 of the averaged amplitudes converges although the input is measured with
    noise, in open and in closed loop. To first order its error is (dY - G dU) U^-1. The variance is
    computed from the scatter of Y - G U over the periods, which includes the cross terms.

    Parameters
    ----------
    frequency_hz
        Frequencies [Hz], shape (F,).
    u
        Complex amplitudes, shape (F, periods), or (F, periods, inputs, experiments) with as many
        experiments as inputs. The noise is assumed to be the same in all experiments.
    y
        Complex amplitudes, shape (F, periods), or (F, periods, outputs, experiments).
    transients
        Number of leading periods to discard.

    Raises
    ------
    InputError
        Fewer than two periods remain; a channel is dead; a value is NaN; or the inputs of the
        experiments are linearly dependent.

    Warns
    -----
    IdentificationWarning
        The excitation is less than five times its own noise.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import periodic_response
    >>> rng = np.random.default_rng(0)
    >>> u = np.ones((2, 8)) + 1e-3 * rng.standard_normal((2, 8))
    >>> found = periodic_response([1.0, 2.0], u, 0.5 * u + 1e-3 * rng.standard_normal((2, 8)))
    >>> found.response.real.round(2).ravel().tolist(), found.degrees
    ([0.5, 0.5], 14.0)
    """
    frequencies = np.atleast_1d(np.asarray(frequency_hz, dtype=float))
    inputs, outputs = _amplitudes(u, "u", frequencies), _amplitudes(y, "y", frequencies)
    count = inputs.shape[2]
    if inputs.shape[3] != count or outputs.shape[3] != count or outputs.shape[1] != inputs.shape[1]:
        raise InputError(
            f"{count} inputs need {count} experiments, and inputs and outputs the same periods; "
            f"u has shape {inputs.shape}, y has {outputs.shape}"
        )
    inputs, outputs = inputs[:, transients:], outputs[:, transients:]
    periods = inputs.shape[1]
    if transients < 0 or periods < 2:
        raise InputError(
            f"{periods} periods are left after {transients} of transients: two are needed for a "
            "variance, four for the intervals of a fit"
        )
    _require_signal(inputs, "input")
    _require_signal(outputs, "output")
    mean_u, mean_y = inputs.mean(axis=1), outputs.mean(axis=1)
    condition = np.linalg.cond(mean_u)
    if not np.all(condition < 1e8):
        at = frequencies[int(np.argmax(condition))]
        raise InputError(f"the experiments do not tell the inputs apart at {at:g} Hz: excite anew")
    inverse = np.linalg.inv(mean_u)
    response = mean_y @ inverse
    du, dy = inputs - mean_u[:, None], outputs - mean_y[:, None]
    residual = dy - response[:, None] @ du
    spare = count * (periods - 1)
    noise = _covariance(residual, residual) / spare
    gain = np.einsum("fei,fej->fij", inverse, inverse.conj())
    spread = np.einsum("foq,fij->foiqj", noise, gain) / periods
    size = response[0].size
    covariance = _covariance(du, du) / spare
    _warn_of_weak_input(frequencies, mean_u, covariance, periods)
    return PeriodicResponse(
        frequency_hz=frequencies,
        response=response,
        variance=np.einsum("foioi->foi", spread).real,
        degrees=2.0 * spare,
        input_covariance=covariance,
        output_covariance=_covariance(dy, dy) / spare,
        cross_covariance=_covariance(dy, du) / spare,
        periods=periods,
        assumptions=assess(np.moveaxis(residual, 1, -1).reshape(-1, periods)),
        covariance=spread.reshape(len(frequencies), size, size),
    )


def _amplitudes(values: ArrayLike, name: str, frequency: np.ndarray) -> np.ndarray:
    """Amplitudes (F, periods, channels, experiments); raises `InputError` for other shapes."""
    array = np.asarray(values, dtype=complex)
    array = array[:, :, None, None] if array.ndim == 2 else array
    if array.ndim != 4 or len(array) != len(frequency):
        raise InputError(
            f"{name} needs shape ({len(frequency)}, periods) or ({len(frequency)}, periods, "
            f"channels, experiments), not {np.shape(values)}"
        )
    wrong = ~np.isfinite(array).all(axis=(1, 2, 3))
    if wrong.any():
        raise InputError(f"{name} is not finite at {frequency[np.argmax(wrong)]:g} Hz")
    return array


def _require_signal(amplitudes: np.ndarray, name: str) -> None:
    """Raise `InputError` if a channel is zero at all frequencies."""
    dead = ~amplitudes.any(axis=(0, 1, 3))
    if dead.any():
        raise InputError(
            f"{name} {np.argmax(dead)} is dead: no amplitude at any frequency; check its cable "
            "and range, or leave it out"
        )


def _covariance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sum of a b^H over periods and experiments, shape (F, channels of a, channels of b)."""
    return np.einsum("fpie,fpje->fij", a, b.conj())


def _warn_of_weak_input(
    frequency: np.ndarray, mean: np.ndarray, covariance: np.ndarray, periods: int
) -> None:
    """Warn if the input is less than five times its noise at some frequency.

    The first-order analysis of the error is not valid there.
    """
    smallest = np.linalg.svd(mean, compute_uv=False)[:, -1]
    noise = np.sqrt(np.einsum("fii->f", covariance).real / periods)
    weak = smallest < 5 * noise
    if weak.any():
        at = frequency[int(np.argmin(smallest / np.where(noise > 0, noise, np.inf)))]
        warnings.warn(
            f"the excitation at {weak.sum()} frequencies, the worst at {at:g} Hz, is less than "
            "five times its own noise: the response is biased and its region too small; raise the "
            "amplitude or average more periods",
            IdentificationWarning,
            stacklevel=3,
        )
