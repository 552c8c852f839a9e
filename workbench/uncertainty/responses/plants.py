"""Responses of several plants on one grid of frequencies: the data for every cover."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import DataArray, Figure, FrequencyResponseData
from workbench.certify.stable_system import angular_frequency, bilinear_frequency
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.identification.record_tests.report import RecordReport, together
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import as_list, is_real, need_numbers
from workbench.systems.frequency_grid import starting_grid
from workbench.uncertainty.responses import measured
from workbench.uncertainty.responses.checked import (
    as_omega,
    known_functions,
    need_below_nyquist,
    plain_values,
    variances,
)
from workbench.uncertainty.responses.measured import Channel
from workbench.uncertainty.responses.ratios import Ratios


@dataclass(frozen=True, eq=False, init=False)
class Responses:
    """Measured or computed responses of N >= 2 plants at F >= 2 frequencies.

    Unlike an `UncertainSystem`, it is a finite set of plants with one input and one output,
    known at frequencies.

    Parameters
    ----------
    omega, frequency_hz
        Frequencies (F,), increasing and positive: ``omega`` in rad/s or ``frequency_hz`` in Hz.
    values
        Complex responses (F, N); finite and nonzero where present.
    present
        Booleans (F, N): which responses were measured; None if all were. At least two plants are
        needed at every frequency.
    plants
        Names of the N plants; with None they are numbered.
    dt
        Sampling time [s] of sampled plants; 0 for continuous plants.
    unit
        Unit of the responses, for labels.
    assumption
        Assumption of the set beyond the measured points, for instance a distribution; see
        `workbench.uncertainty.widened_responses`. Certificates of covers contain it.
    known
        The N plants as systems, if they are known at every frequency: stable SISO systems of
        python-control or `Rational`s, and None for a plant that was only measured. Covers contain
        known plants at every frequency, also between the given ones. Sampled plants are stored as
        functions of the bilinear plane.
    variance
        E|error|^2 of the responses (F, N), or a number for all; with None they count as exact.
    degrees
        Real degrees of freedom of the variance: a number, or one for each plant (N,).
    read
        Report on how the responses were read, if they come from files.
    confidence
        If given, the values are corners of confidence regions, each with this probability; see
        `workbench.uncertainty.responses.regions`.
    ratios
        Joint covariances, if the responses are ratios of two estimates, as for plants in closed
        loops; otherwise None.
    reports
        Reports on the records from which the responses were estimated, by name. Certificates of
        covers contain their results.

    Raises
    ------
    InputError
        Data do not have these forms; or a known plant is unstable or has other responses. The
        message names the plant and the frequency.
    """

    omega: RealArray
    values: ComplexArray
    present: np.ndarray
    plants: tuple[str, ...]
    dt: float
    unit: str
    assumption: str
    known: tuple[Rational | None, ...]
    variance: RealArray | None
    degrees: RealArray
    read: str
    confidence: float | None
    ratios: Ratios | None
    reports: Mapping[str, RecordReport]

    def __init__(
        self,
        *,
        omega: Any = None,
        values: Any = None,
        present: Any = None,
        plants: Any = None,
        frequency_hz: Any = None,
        dt: float = 0.0,
        unit: str = "1",
        assumption: str = "",
        known: Any = None,
        variance: Any = None,
        degrees: Any = math.inf,
        read: str = "",
        confidence: float | None = None,
        ratios: Ratios | None = None,
        reports: Mapping[str, RecordReport] | None = None,
    ) -> None:
        omega = as_omega(omega, frequency_hz)
        need_below_nyquist(omega, dt)
        if values is None:
            raise InputError(
                "values are needed: complex responses of shape (F, N), a column for each plant"
            )
        try:
            values = np.asarray(plain_values(values))
        except Exception as error:  # an object that is no array may say so by any error
            raise InputError(f"responses must be an array of numbers: {error}") from None
        if values.dtype.kind not in "iufc":
            raise InputError(f"responses must be numbers, they have type {values.dtype}")
        if values.ndim != 2 or len(values) != omega.size:
            raise InputError(
                f"responses of shape {values.shape} do not fit {omega.size} frequencies; "
                "needed is (F, N), a column for each plant"
            )
        if values.shape[1] < 2:
            raise InputError("one plant has no spread to cover: two or more are needed")
        present = np.ones(values.shape, bool) if present is None else np.array(present)
        if present.shape != values.shape or present.dtype != bool:
            raise InputError(f"present must be booleans of shape {values.shape}")
        given = range(1, values.shape[1] + 1) if plants is None else as_list(plants, "plants")
        names = tuple(map(str, given))
        if len(names) != values.shape[1]:
            raise InputError(f"{len(names)} names for {values.shape[1]} plants")
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"two plants are called {twice!r}; give each a name of its own")
        fields = {
            "omega": omega,
            "values": values.astype(complex),
            "present": present,
            "plants": names,
            "dt": dt,
            "unit": unit,
            "assumption": assumption,
            "read": read,
            "confidence": confidence,
            "ratios": ratios,
            "reports": dict(reports or {}),
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        self._refuse(~np.isfinite(values), "is not finite")
        self._refuse(values == 0, "is exactly zero")
        few = present.sum(axis=1) < 2
        if few.any():
            raise InputError(
                f"only {present[few.argmax()].sum()} plant was measured at "
                f"{self.place(int(few.argmax()))}: two or more are needed at every frequency"
            )
        object.__setattr__(self, "known", known_functions(self, tuple(known or ())))
        for name, value in zip(
            ("variance", "degrees"), variances(self, variance, degrees), strict=True
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def from_frd(
        cls,
        systems: Sequence[FrequencyResponseData],
        *,
        input: Channel = None,
        output: Channel = None,
        **names: Any,
    ) -> Responses:
        """Responses of plants, each of which was measured at its own frequencies.

        The grid is the union of all frequencies; a plant counts as missing where it was not
        measured.

        Parameters
        ----------
        systems
            `control.FrequencyResponseData` objects, frequencies in rad/s.
        input, output
            The channel, by name or by number from 0, for plants with several channels.
        names
            ``plants``, ``dt``, ``unit``, ``assumption`` and ``known`` of `Responses`.

        Raises
        ------
        InputError
            As in `Responses`; in particular if different grids leave fewer than two plants at a
            frequency.
        """
        return cls(**measured.from_frd(systems, input, output, names))

    @classmethod
    def from_estimates(
        cls,
        estimates: Sequence[ResponseEstimate],
        *,
        input: int = 0,
        output: int = 0,
        spread: float | None = None,
        resonance_shift: float | None = None,
        **names: Any,
    ) -> Responses:
        """Estimated responses with their variances, all at the same frequencies.

        ``input`` and ``output`` are the numbers of the channel, from 0; ``names`` are as in
        `from_frd`. A single estimate needs a ``spread`` or a ``resonance_shift``, as in
        `from_files`. Raises InputError as in `Responses`, and for different frequencies.

        Examples
        --------
        >>> import numpy as np
        >>> from workbench.identification import ResponseEstimate
        >>> from workbench.uncertainty import Responses
        >>> frequency = np.array([1.0, 2.0])
        >>> response = np.array([2.0, 1.0 - 1j])[:, None, None]
        >>> rig = ResponseEstimate(frequency, response, np.full((2, 1, 1), 1e-4), 40.0)
        >>> found = Responses.from_estimates(rig, spread=0.2)
        >>> found.assumption
        'stated, not measured: the plants of which one was measured have responses within 20 % ...'
        """
        return cls(
            **measured.from_estimates(estimates, input, output, spread, resonance_shift, names)
        )

    @classmethod
    def from_files(
        cls,
        files: str | PathLike[str] | Sequence[str | PathLike[str]],
        *,
        input: str | None = None,
        output: str | None = None,
        time: str | None = None,
        dt: float | None = None,
        frequency: str | None = None,
        response: str | tuple[str, str] | None = None,
        excitation: str | int | None = None,
        assume: str | Sequence[str] = (),
        most: int = 200,
        hold: bool = False,
        spread: float | None = None,
        resonance_shift: float | None = None,
        **names: Any,
    ) -> Responses:
        """Responses of plants from files, one for each plant; the file's name is the plant's name.

        For records, name the ``input``, the ``output`` and the ``time`` (or give the sampling
        frequency). The response and its variance are then estimated: from whole periods if the
        input has many, and otherwise by local models (`local_response`). For frequency responses,
        name the ``frequency_hz`` and the ``response`` (or its two parts, or magnitude and phase).
        ``read`` reports how the files were read. Files in other units are converted to the units of
        the first one. The response of a record is that from samples to samples. It includes the
        delay of the converters, and also the hold, unless ``hold`` removes it.

        Each record is tested (`record_report`); the results are in ``reports``. A record of a
        closed loop is refused unless its ``excitation`` is named; the response is then estimated by
        `driven_response`.

        Parameters
        ----------
        files
            A pattern such as ``"drive*.csv"``, or paths; files are read as by `read_record`.
        excitation
            Name of the external signal that excites a closed loop, such as the set-point; or, if it
            was not recorded but is periodic, its period [samples].
        assume
            Assumptions on the records that you guarantee against their reports, such as "open
            loop"; certificates say so.
        most
            Largest number of frequencies taken from a record.
        hold
            Whether the input was held from sample to sample, and the hold is to be removed from the
            response. Above about 0.6 of half the sampling frequency the result is distorted.
        spread
            Stated, not measured, spread of plants around those with records, even around a single
            one: relative radius of a disc around each response, 0.2 for 20 %.
        resonance_shift
            Largest relative shift of the plants' frequencies, including resonances; also stated.
        names
            ``plants``, ``dt``, ``unit``, ``assumption`` and ``known`` of `Responses`.

        Raises
        ------
        InputError
            As in `Responses`, `read_record` and `read_response`; no file fits the pattern; the
            names belong neither to a record nor to a response; or a test forbids the use of a
            record.
        """
        record = measured.RecordNames(input, output, time, dt, excitation, assume)
        return cls(
            **measured.from_files(
                files, record, frequency, response, most, hold, spread, resonance_shift, names
            )
        )

    def __repr__(self) -> str:
        names = self.plants if len(self.plants) <= 4 else (*self.plants[:2], "...", self.plants[-1])
        noise = "taken as exact" if self.variance is None else "with variances"
        if self.confidence is not None:
            noise = f"corners of {100 * self.confidence:g} % regions"
        lines = [
            f"Responses [{self.unit}] of {len(self.plants)} plants ({', '.join(names)})",
            f"  at {self.omega.size} frequencies from {self.frequency_hz[0]:.4g} to "
            f"{self.frequency_hz[-1]:.4g} Hz, {noise}",
        ]
        lines += [f"  {self.read}"] * bool(self.read)
        return "\n".join(lines + [f"  found: {'; '.join(self._findings)}"] * bool(self._findings))

    @property
    def _findings(self) -> list[str]:
        """What was found in the records, each with the names of their plants."""
        plants: dict[str, list[str]] = {}
        for name, report in self.reports.items():
            for kind in dict.fromkeys(finding.kind for finding in report.findings):
                plants.setdefault(kind, []).append(name)
        return [f"{kind} ({', '.join(names)}), see reports" for kind, names in plants.items()]

    def plot(self) -> Figure:
        """Bode plot of the responses of all plants."""
        values = np.where(self.present, self.values, np.nan)
        curves = dict(zip(self.plants, values.T, strict=True))
        return figures.bode_plot(self.frequency_hz, curves, self.unit, many=f"{len(curves)} plants")

    @property
    def known_plants(self) -> dict[str, Rational]:
        """The plants known at every frequency, by name."""
        pairs = zip(self.plants, self.known, strict=False)
        return {name: plant for name, plant in pairs if plant is not None}

    @property
    def tested(self) -> tuple[str, ...]:
        """Tests of the records with their results, and tests that were not possible."""
        return together(self.reports)

    @property
    def over(self) -> str:
        """The frequencies and plants for which a statement about these responses holds, in
        words.
        """
        at = f"at the {self.omega.size} given frequencies"
        if self.confidence is None:
            return f"{at}, for these {len(self.plants)} plants"
        return f"{at}, for the {100 * self.confidence:g} % regions of these plants"

    def _refuse(self, bad: np.ndarray, what: str) -> None:
        """Raise `InputError` if a measured response is bad; the message names the first one."""
        bad = bad & self.present
        if bad.any():
            k, i = (int(j) for j in np.argwhere(bad)[0])
            raise InputError(
                f"the response of plant {self.plants[i]} {what} at {self.place(k)}; "
                "mark what was not measured with present=False"
            )

    @property
    def frequency_hz(self) -> RealArray:
        """Frequencies (F,) [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest frequency [rad/s]."""
        return float(self.omega[0]), float(self.omega[-1])

    @property
    def axis(self) -> RealArray:
        """Frequencies (F,) [rad/s]; for sampled plants those of the bilinear plane, in which they
        are fitted.
        """
        return np.asarray(bilinear_frequency(self.omega, self.dt))

    @property
    def shares(self) -> RealArray:
        """Share (F,) of each frequency in the logarithmic frequency axis; their sum is 1."""
        width = np.gradient(np.log(self.omega))
        return width / width.sum()

    def thinned(self, most: int) -> Responses:
        """The same plants at no more than ``most`` frequencies, including the first and the
        last.
        """
        if self.omega.size <= most:
            return self
        return self.at(np.unique(np.linspace(0, self.omega.size - 1, most).round().astype(int)))

    def within(self, low_hz: float, high_hz: float) -> Responses:
        """The same plants at the frequencies from `low_hz` to `high_hz` [Hz].

        Raises InputError if fewer than two frequencies remain.
        """
        need_numbers(low_hz=low_hz, high_hz=high_hz)
        chosen = np.flatnonzero((self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz))
        if chosen.size < 2:
            raise InputError(
                f"{chosen.size} frequencies lie from {low_hz:g} to {high_hz:g} Hz; two are "
                "needed of "
                f"those from {self.frequency_hz[0]:.6g} to {self.frequency_hz[-1]:.6g} Hz"
            )
        return self.at(chosen)

    def at(self, chosen: np.ndarray) -> Responses:
        """The same plants at some of the frequencies, by index."""
        return replace(
            self,
            omega=self.omega[chosen],
            values=self.values[chosen],
            present=self.present[chosen],
            variance=None if self.variance is None else self.variance[chosen],
            ratios=None if self.ratios is None else self.ratios.at(chosen),
        )

    def linear_within(self, share: float) -> Responses:
        """The same plants with a larger variance, for nonlinear plants whose linear models differ
        from the responses.

        A nonlinear plant responds differently to large and to small excitations. Neither the
        scatter of periods nor records with one amplitude show this difference, so it must be
        stated.

        Parameters
        ----------
        share
            Standard deviation of the difference, relative to the response; 0.01 is 1 %.

        Raises
        ------
        InputError
            The share is negative or at least 1; or the responses have no variance.

        Examples
        --------
        >>> import numpy as np
        >>> from workbench.uncertainty import Responses
        >>> known = Responses(
        ...     omega=np.array([1.0, 2.0]), values=np.full((2, 2), 3.0 + 0j), variance=0.0016
        ... )
        >>> np.sqrt(known.linear_within(0.01).variance[0]).round(4).tolist()
        [0.05, 0.05]
        """
        if not (is_real(share) and 0.0 <= share < 1.0):
            raise InputError(f"share is {share!r}; it must be 0 or more and below 1: 0.01 for 1 %")
        if self.variance is None:
            raise InputError("the responses have no variance that a share could be added to")
        added = np.where(self.present, share * np.abs(self.values), 0.0) ** 2
        ratios = None if self.ratios is None else self.ratios.with_numerator(added)
        said = f"stated, not measured: linear plants lie {100 * share:g} % off the responses, rms"
        assumption = "; ".join(filter(None, [self.assumption, said if share else ""]))
        return replace(self, variance=self.variance + added, ratios=ratios, assumption=assumption)

    def refined(self) -> Responses:
        """The same plants at further frequencies of the band that show the resonances of known
        plants.

        If a plant was only measured, nothing is known between the frequencies, and none are added.
        """
        known = list(self.known_plants.values())
        if len(known) < len(self.plants):
            return self
        poles = np.concatenate([plant.poles for plant in known])
        more = angular_frequency(starting_grid(poles), self.dt)
        more = more[(more > self.omega[0]) & (more < self.omega[-1])]
        omega = np.union1d(self.omega, more)
        axis = bilinear_frequency(omega, self.dt)
        values = np.stack([plant.response(axis) for plant in known], axis=1)
        given = np.searchsorted(omega, self.omega)
        values[given] = np.where(self.present, self.values, values[given])
        present = np.ones(values.shape, bool)
        present[given] = self.present
        return replace(self, omega=omega, values=values, present=present)

    def place(self, index: int) -> str:
        """A frequency as text, for messages."""
        return f"{self.omega[index] / (2 * np.pi):.6g} Hz"

    @property
    def points(self) -> ComplexArray:
        """Point sets (F, N); a missing point is replaced by another point of its set."""
        return filled(self.values, self.present)

    def labelled_points(self) -> DataArray:
        """The point sets as a labelled array with names and units, dims (frequency, plant)."""
        import xarray as xr

        axis = {"units": "Hz", "long_name": "frequency"}
        return xr.DataArray(
            self.points,
            dims=("frequency", "plant"),
            coords={
                "frequency": ("frequency", self.frequency_hz, axis),
                "plant": list(self.plants),
            },
            attrs={"units": self.unit, "long_name": "response"},
        )


def filled(values: ComplexArray, present: np.ndarray) -> ComplexArray:
    """Values (F, N), each missing value replaced by the first measured one at its frequency."""
    substitute = values[np.arange(len(values)), present.argmax(axis=1)]
    points: ComplexArray = np.where(present, values, substitute[:, None])
    return points
