"""Response to a periodic excitation from a record with transients, by local polynomials.

Between the lines of the excitation, a record of several periods contains only transient and noise.
There a polynomial in a narrow band about each excited line is fitted to the transient, which is
smooth over frequency, and subtracted at that line; the residual is the noise. So no period is
discarded, and two are enough. The variance is due to noise alone: it contains neither transients
nor nonlinear distortion, since the distortion of a periodic excitation is periodic.

Distortion shows at harmonics that are not excited: an even nonlinearity at even ones, an odd one at
odd ones. The distortion at an excited harmonic is estimated from the silent odd harmonics near by,
scaled by the response, since most of it passes through the same resonances.

Source: R. Pintelon, J. Schoukens, G. Vandersteen and K. Barbe, Mechanical Systems and Signal
Processing 24, 2010, part II ("robust method"); J. Schoukens, R. Pintelon and Y. Rolain, Mastering
System Identification in 100 Exercises, 2012, chapter 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.distortion import LineDistortion, distortion_of_lines
from workbench.identification.experiments.quality import as_record, require_alive
from workbench.identification.responses.line_sums import LineSums
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.identification.responses.repeated_rounding import (
    FEWEST_LEVELS,
    repeated_rounding,
)
from workbench.identification.responses.transients import without_transient
from workbench.input_checks import need_count, need_positive, need_whole

SPARE_LINES = 8
"""Number of lines in a band minus the unknowns of its polynomial."""
UNEXCITED = 1e-8
"""An input whose amplitude, relative to the largest at any line, is below this does not excite."""
NEAREST_SILENT = 6
"""Number of silent odd harmonics from which the distortion at an excited one is estimated."""


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicLocalResponse(ResponseEstimate):
    """A response at the excited harmonics, with the covariance due to noise.

    Unlike a `ResponseEstimate` in general, it tells noise, distortion and transient apart.

    Parameters
    ----------
    covariance
        Covariance (F, ny nu, ny nu) of the entries of the response, row by row, due to noise alone.
    distorted_variance
        E|error|^2 (F, ny, nu) of the best linear approximation, due to noise and to the distortion
        that this realisation of the excitation causes. NaN without silent odd harmonics.
    distortion
        Distortion of each output at the silent harmonics; None unless both odd and even harmonics
        are silent between the excited ones.
    transient
        Share (F, ny) of the transient in the power at the excited lines.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import periodic_local_polynomial
    >>> lines, samples = np.array([1, 3, 5, 7]), 64
    >>> u = sum(np.cos(2 * np.pi * k * np.arange(4 * samples) / samples + k**2) for k in lines)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = periodic_local_polynomial(u[:, None], y[:, None], samples, lines=lines)
    >>> found.frequency_hz.tolist(), found.transient.shape
    ([0.015625, 0.046875, 0.078125, 0.109375], (4, 1))
    """

    covariance: ComplexArray
    distorted_variance: RealArray
    distortion: tuple[LineDistortion, ...] | None
    transient: RealArray


class PeriodicStream:
    """A periodic record that arrives in pieces, and its response once it is complete.

    Parameters
    ----------
    period
        Period in samples.
    periods
        Number of periods of the record, at least 2.
    lines
        Excited harmonics (F,) of the period, rising, from 1 to below half the period; None: all.
    degree
        Degree of the polynomials of the transient.
    rational
        Whether transients may have poles narrower than a band, as in `periodic_local_rational`.

    Raises
    ------
    InputError
        Numbers out of range.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import PeriodicStream, periodic_local_polynomial
    >>> lines, samples = np.array([1, 3, 5, 7]), 64
    >>> u = sum(np.cos(2 * np.pi * k * np.arange(4 * samples) / samples + k**2) for k in lines)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> stream = PeriodicStream(samples, periods=4, lines=lines)
    >>> for k in range(4):
    ...     stream.add(u[64 * k : 64 * (k + 1), None], y[64 * k : 64 * (k + 1), None])
    ...
    >>> whole = periodic_local_polynomial(u[:, None], y[:, None], samples, lines=lines)
    >>> bool(np.allclose(stream.response().response, whole.response))
    True
    """

    def __init__(
        self,
        period: int,
        periods: int,
        *,
        lines: ArrayLike | None = None,
        degree: int = 2,
        rational: bool = False,
    ) -> None:
        need_count("period", period)
        need_whole(degree, "degree")
        if periods < 2 or degree < 0:
            raise InputError(
                f"{periods} periods and degree {degree}: two periods and degree 0 at least are "
                "needed, since only lines between the excited ones tell noise and transient"
            )
        last = (period - 1) // 2
        given = np.arange(1, last + 1) if lines is None else np.asarray(lines)
        self.lines: IntegerArray = LineSums(period, periods, given, 1).harmonics
        self.degree, self.rational = int(degree), rational
        self._records: list[LineSums] = []
        self._periods, self._period = int(periods), int(period)
        self._inputs = 0
        self._rounding: RealArray | None = None

    def _new_sums(self) -> LineSums:
        """Empty sums at every harmonic from the first excited one to the last."""
        wanted = (2 if self.rational else 1) * self.degree + 1 + SPARE_LINES
        reach = 1
        while sum(r % self._periods != 0 for r in range(-reach, reach + 1)) < wanted:
            reach += 1
        every = np.arange(self.lines[0], self.lines[-1] + 1)
        return LineSums(self._period, self._periods, every, reach)

    def add(self, u: ArrayLike, y: ArrayLike, *, experiment: int = 0) -> None:
        """Add the next samples u (N, nu) and y (N, ny) of an experiment, numbered from 0.

        Raises
        ------
        InputError
            Wrong shapes, values that are not finite, or more samples than were announced.
        """
        u, y = (np.asarray(x, float) for x in (u, y))
        if u.ndim != 2 or y.ndim != 2 or len(u) != len(y):
            raise InputError(f"u {u.shape} and y {y.shape} must be (N, nu) and (N, ny)")
        need_whole(experiment, "experiment")
        if not 0 <= experiment <= len(self._records):
            raise InputError(f"experiment {experiment} comes after {len(self._records)}")
        if experiment == len(self._records):
            self._records.append(self._new_sums())
        self._inputs = self._inputs or u.shape[1]
        if u.shape[1] != self._inputs:
            raise InputError(f"{u.shape[1]} inputs after {self._inputs}")
        self._records[experiment].add(np.hstack([y, u]))

    def _count_rounding(self, variance: RealArray) -> None:
        """Add to the variance the rounding of samples (ny + nu,) that repeats in each period.

        It is at the excited lines only, so the lines between do not show it.
        """
        self._rounding = self._periods * variance

    def response(self, *, dt: float = 1.0) -> PeriodicLocalResponse:
        """The response, when all samples have arrived; ``dt`` [s]: their sampling time.

        Raises
        ------
        InputError
            Samples are missing; there are not as many experiments as inputs; or a band has too few
            lines.
        """
        need_positive(dt, "dt")
        if len(self._records) != max(self._inputs, 1):
            raise InputError(f"{self._inputs} inputs need as many experiments")
        sums = self._records[0]
        spectra = np.stack([record.transform() for record in self._records], axis=-1)
        spectra = np.moveaxis(spectra, 0, 1)  # (harmonics, offsets, channels, experiments)
        clean, spread, spare = without_transient(
            spectra, sums.offsets, sums.harmonics * self._periods, self._periods,
            self._period * self._periods, self.degree, rational=self.rational,
        )  # fmt: skip
        if self._rounding is not None:
            spread = spread + np.diag(self._rounding)
        at = np.searchsorted(sums.harmonics, self.lines)
        outputs = clean.shape[1] - self._inputs
        Y, U = clean[at, :outputs], clean[at, outputs:]
        sizes = np.linalg.svd(U, compute_uv=False)
        largest = np.linalg.norm(clean[:, outputs:], axis=(1, 2)).max()
        dark = sizes[:, -1] <= UNEXCITED * largest
        if dark.any():
            k = int(self.lines[np.argmax(dark)])
            raise InputError(f"the inputs do not excite harmonic {k}, or move together there")
        noise = np.einsum("fii->fi", spread[at]).real[:, outputs:].sum(axis=1) * self._inputs
        hidden = np.linalg.norm(U, axis=(1, 2)) ** 2 <= noise
        if 2 * hidden.sum() > hidden.size:
            raise InputError(
                f"at {hidden.sum()} of {hidden.size} harmonics the inputs are no larger than "
                f"between the harmonics: is the period {self._period} samples, and are these the "
                "excited harmonics?"
            )
        inverse = np.linalg.inv(U)
        G = Y @ inverse
        ways = np.concatenate([np.broadcast_to(np.eye(outputs), (len(G), outputs, outputs)), -G], 2)
        own = ways @ spread[at] @ ways.conj().swapaxes(1, 2)
        gain = np.einsum("fei,fej->fij", inverse, inverse.conj())
        covariance = np.einsum("foq,fij->foiqj", own, gain)
        degrees = 2.0 * spare * len(self._records)
        silent = np.setdiff1d(sums.harmonics, self.lines)
        found = _Distortion(clean, spread, sums.harmonics, self.lines, G, outputs, degrees)
        extra = found.near(self.lines)
        variance = np.einsum("foioi->foi", covariance).real
        middle = spectra[at, sums.offsets.size // 2, :outputs]
        power = np.sum(np.abs(middle) ** 2, axis=-1)
        share = np.sum(np.abs(middle - Y) ** 2, axis=-1) / np.where(power > 0, power, 1.0)
        size = G[0].size
        return PeriodicLocalResponse(
            frequency_hz=self.lines / dt / self._period,
            response=G,
            variance=variance,
            degrees=degrees,
            covariance=covariance.reshape(len(G), size, size),
            distorted_variance=variance
            + extra[:, :, None] * np.einsum("fii->fi", gain).real[:, None, :],
            distortion=found.tests(silent),
            transient=share,
        )


def periodic_local_polynomial(
    u: ArrayLike,
    y: ArrayLike,
    period: int,
    *,
    lines: ArrayLike | None = None,
    degree: int = 2,
    dt: float = 1.0,
) -> PeriodicLocalResponse:
    """Response from u to y at the excited harmonics of a periodic excitation.

    Parameters
    ----------
    u
        Inputs: (N, nu) for one experiment with a single input, or (N, nu, experiments) with as many
        experiments as inputs.
    y
        Outputs, (N, ny) or (N, ny, experiments).
    period
        Period in samples. The last whole periods of the record are used, at least two.
    lines
        Excited harmonics (F,) of the period, rising; None: every one below half the sampling rate.
    degree
        Degree of the polynomials of the transient.
    dt
        Sampling time [s].

    Raises
    ------
    InputError
        Wrong shapes, values that are not finite, dead channels, fewer than two periods, inputs that
        do not excite a line, or not as many experiments as inputs.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import periodic_local_polynomial
    >>> lines, samples = np.array([1, 3, 5, 7]), 64
    >>> u = sum(np.cos(2 * np.pi * k * np.arange(4 * samples) / samples + k**2) for k in lines)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> found = periodic_local_polynomial(u[:, None], y[:, None], samples, lines=lines)
    >>> exact = 0.5 / (np.exp(2j * np.pi * lines / samples) - 0.5)
    >>> bool(abs(found.response[:, 0, 0] - exact).max() < 1e-3)
    True
    """
    return _of_record(u, y, period, lines, degree, dt, rational=False)


def periodic_local_rational(
    u: ArrayLike,
    y: ArrayLike,
    period: int,
    *,
    lines: ArrayLike | None = None,
    degree: int = 2,
    dt: float = 1.0,
) -> PeriodicLocalResponse:
    """As `periodic_local_polynomial`, if transients of lightly damped modes outlive the record.

    Such a transient is a pole in a band, which a polynomial cannot follow. If the residuals
    indicate one, the transient is a rational function with numerator and denominator of this
    degree; otherwise the polynomial is kept, which is less sensitive to noise. Bands are wider by
    the degree.

    Parameters and errors are those of `periodic_local_polynomial`.

    Source: R. Pintelon et al. as above; T. McKelvey and G. Guérin, 16th IFAC Symposium on System
    Identification, 2012.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import periodic_local_polynomial, periodic_local_rational
    >>> lines, samples = np.arange(1, 30), 128
    >>> u = sum(np.cos(2 * np.pi * k * np.arange(4 * samples) / samples + k**2) for k in lines)
    >>> mode = control.tf([1.0], [1.0, -1.8, 0.999], 1.0)
    >>> y = control.forced_response(mode, inputs=u).outputs
    >>> exact = mode(np.exp(2j * np.pi * lines / samples))
    >>> ways = (periodic_local_polynomial, periodic_local_rational)
    >>> found = [way(u[:, None], y[:, None], samples, lines=lines).response for way in ways]
    >>> [bool(abs(one[:, 0, 0] / exact - 1).max() < 1e-3) for one in found]
    [False, True]
    """
    return _of_record(u, y, period, lines, degree, dt, rational=True)


def _of_record(
    u: ArrayLike,
    y: ArrayLike,
    period: int,
    lines: ArrayLike | None,
    degree: int,
    dt: float,
    *,
    rational: bool,
) -> PeriodicLocalResponse:
    """The response of a record that is given as a whole."""
    pair = []
    for name, given in (("u", u), ("y", y)):
        values = as_record(given, name=name)
        values = values[..., None] if values.ndim == 2 else values
        if values.ndim != 3:
            raise InputError(f"{name} has shape {values.shape}; (N, channels, experiments) needed")
        require_alive(np.concatenate(np.moveaxis(values, -1, 0)).T, name)  # dead in some experiment
        pair.append(values)
    inputs, outputs = pair
    if len(inputs) != len(outputs) or inputs.shape[2] != outputs.shape[2]:
        raise InputError(f"u has shape {inputs.shape}, y {outputs.shape}: they do not belong")
    need_count("period", period)
    stream = PeriodicStream(
        period, len(inputs) // period, lines=lines, degree=degree, rational=rational
    )
    first = len(inputs) % period
    for experiment in range(inputs.shape[2]):
        stream.add(
            inputs[first:, :, experiment], outputs[first:, :, experiment], experiment=experiment
        )
    rounding = [
        max(repeated_rounding(one, period, fewest) for one in channel)
        for values, fewest in ((outputs, 2), (inputs, FEWEST_LEVELS))
        for channel in np.moveaxis(values, 0, -1)
    ]
    stream._count_rounding(np.array(rounding))
    return stream.response(dt=dt)


class _Distortion:
    """Distortion at the silent harmonics: the part that the response does not explain."""

    def __init__(
        self,
        clean: ComplexArray,
        noise: ComplexArray,
        harmonics: IntegerArray,
        lines: IntegerArray,
        response: ComplexArray,
        outputs: int,
        degrees: float,
    ) -> None:
        self.harmonics, self.lines, self.degrees = harmonics, lines, degrees
        everywhere = np.empty((harmonics.size, *response.shape[1:]), complex)
        for i, j in np.ndindex(response.shape[1:]):
            everywhere[:, i, j] = np.interp(harmonics, lines, response[:, i, j])
        self.left = clean[:, :outputs] - everywhere @ clean[:, outputs:]
        ways = np.concatenate(
            [np.broadcast_to(np.eye(outputs), (len(clean), outputs, outputs)), -everywhere], axis=2
        )
        spread = ways @ noise @ ways.conj().swapaxes(1, 2)
        self.noise = np.einsum("kii->ki", spread).real
        self.size = np.sum(np.abs(everywhere) ** 2, axis=2)
        self.clean = clean[:, :outputs]

    def near(self, lines: IntegerArray) -> RealArray:
        """Mean square (F, ny) of the distortion near each line, in one experiment.

        It is the mean over the nearest silent odd harmonics, without the noise's share, and never
        negative.
        """
        silent = np.setdiff1d(self.harmonics, self.lines)
        silent = silent[silent % 2 == 1]
        if not silent.size:
            return np.full((lines.size, self.left.shape[1]), np.nan)
        at = np.searchsorted(self.harmonics, silent)
        square = np.mean(np.abs(self.left[at]) ** 2, axis=-1) - self.noise[at]
        square = square / np.maximum(self.size[at], np.finfo(float).tiny)
        count = min(NEAREST_SILENT, silent.size)
        nearest = np.argsort(np.abs(lines[:, None] - silent), axis=1)[:, :count]
        own = self.size[np.searchsorted(self.harmonics, lines)]
        found: RealArray = own * np.maximum(square[nearest].mean(axis=1), 0.0)
        return found

    def tests(self, silent: IntegerArray) -> tuple[LineDistortion, ...] | None:
        """Distortion of each output; None unless there are silent harmonics of both kinds."""
        parts = [silent[silent % 2 == parity] for parity in (1, 0)]
        if not all(part.size for part in parts):
            return None
        excited, odd, even = (
            np.searchsorted(self.harmonics, part) for part in (self.lines, *parts)
        )
        found = []
        for output in range(self.left.shape[1]):
            values = [self.clean[excited, output], self.left[odd, output], self.left[even, output]]
            noises = [np.repeat(self.noise[at, output], self.left.shape[-1]) for at in (odd, even)]
            means = [each.ravel() for each in values]
            found.append(distortion_of_lines(means, noises, int(self.degrees)))
        return tuple(found)
