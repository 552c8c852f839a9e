"""Matrix responses of several plants on one grid of frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.certify.stable_system import bilinear_frequency
from workbench.errors import InputError
from workbench.fitting.samples import as_count, as_frequencies
from workbench.input_checks import as_array, as_list, common_time_base, need_sampling_time
from workbench.realisations import minimal_realisation
from workbench.systems.conversion import as_system
from workbench.systems.frequency_response import frequency_response
from workbench.systems.range_hints import warn_far_frequencies
from workbench.uncertainty.responses.plants import Responses

SAME_FREQUENCIES = 1e-9
"""Largest relative difference of frequencies that count as the same. It is the rounding of files
with nine digits. Half or double decides the same.
"""


@dataclass(frozen=True, eq=False)
class MatrixResponses:
    """Responses (F, N, p, m) of N plants with p outputs and m inputs.

    Unlike `Responses`, it has plants of several inputs and outputs, and no value may be missing.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s], positive and increasing; below half the sampling rate for sampled
        plants.
    values
        Complex responses (F, N, p, m).
    plants
        Names of the plants; with None they are numbered.
    dt
        Sampling time [s]; 0 for continuous time.
    known
        The plants as systems, if they are known; see `of_systems`.

    Raises
    ------
    InputError
        The data do not have these forms.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import MatrixResponses
    >>> rng, omega = np.random.default_rng(0), np.geomspace(0.1, 10, 6)
    >>> plants = 1 + 0.1 * rng.standard_normal((6, 5, 2, 2)) + np.eye(2)
    >>> responses = MatrixResponses(omega, plants + 0j)
    >>> responses.values.shape, len(responses.plants)
    ((6, 5, 2, 2), 5)
    """

    omega: RealArray
    values: Array
    _: KW_ONLY
    plants: Any = None
    dt: float = 0.0
    known: tuple[StateSpace, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", as_frequencies(self.omega))
        values = as_array(self.values, "values", dtype=complex)
        if values.ndim != 4 or len(values) != self.omega.size or not values.size:
            raise InputError(
                f"responses of shape {values.shape} do not fit {self.omega.size} frequencies; "
                "needed is (F, N, p, m): N plants with p outputs and m inputs"
            )
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            f, k = bad[0][:2]
            raise InputError(f"plant {k + 1} at {self.omega[f]:.6g} rad/s is not finite")
        object.__setattr__(self, "values", values)
        given = range(1, values.shape[1] + 1) if self.plants is None else self.plants
        names = tuple(map(str, as_list(given, "plants")))
        if len(names) != values.shape[1] or len(set(names)) < len(names):
            raise InputError(f"plants are {names}; {values.shape[1]} different names are needed")
        object.__setattr__(self, "plants", names)
        if self.dt and self.omega[-1] * self.dt >= np.pi:
            raise InputError(
                f"omega goes up to {self.omega[-1]:.6g} rad/s; half the sampling rate is "
                f"{np.pi / self.dt:.6g} rad/s"
            )

    @classmethod
    def of_systems(
        cls, systems: Sequence[Any], omega: Any, *, plants: Any = None
    ) -> MatrixResponses:
        """Responses of python-control systems, which stay known between the frequencies.

        So an additive cover of stable systems contains them at every frequency.

        Raises InputError for systems of different sizes or sampling times.
        """
        given = as_list(systems, "systems")
        if any(hasattr(each, "frdata") for each in given):
            raise InputError(
                "systems are measured responses, which have frequencies of their own: give them to "
                "MatrixResponses.from_frd"
            )
        found = [as_system(each, f"plant {k + 1}") for k, each in enumerate(given)]
        if not found:
            raise InputError("there are no systems; one or more are needed")
        sizes = {(each.noutputs, each.ninputs) for each in found}
        if len(sizes) > 1:
            raise InputError(
                f"plants differ in (outputs, inputs): {', '.join(map(str, sorted(sizes)))}"
            )
        dt = common_time_base(each.dt for each in found)
        need_sampling_time(dt, "each plant")
        omega = as_frequencies(omega)
        warn_far_frequencies(omega, found[0])
        values = np.stack([system_response(each, omega) for each in found], axis=1)
        return cls(omega, values, plants=plants, dt=float(dt or 0.0), known=tuple(found))

    @classmethod
    def from_frd(cls, systems: Sequence[Any], *, plants: Any = None) -> MatrixResponses:
        """Responses from python-control's FrequencyResponseData, all at the same frequencies."""
        found = as_list(systems, "systems")
        try:
            omegas = [np.asarray(each.omega, dtype=float) for each in found]
            values = [np.moveaxis(np.asarray(each.frdata), -1, 0) for each in found]
        except AttributeError:
            raise InputError("systems must be FrequencyResponseData of python-control") from None
        for k, (omega, value) in enumerate(zip(omegas, values, strict=True)):
            if omega.shape != omegas[0].shape or not np.allclose(
                omega, omegas[0], rtol=SAME_FREQUENCIES, atol=0
            ):
                raise InputError(f"plant {k + 1} was measured at other frequencies than plant 1")
            if value.shape != values[0].shape:
                raise InputError(
                    f"plant {k + 1} has {value.shape[1]} outputs and {value.shape[2]} inputs, "
                    f"plant 1 has {values[0].shape[1]} and {values[0].shape[2]}"
                )
        dt = common_time_base(each.dt for each in found)
        need_sampling_time(dt, "each plant")
        return cls(omegas[0], np.stack(values, axis=1), plants=plants, dt=float(dt or 0.0))

    def channel(self, output: int, input: int) -> Responses:
        """Responses from one input to one output, both counted from 0.

        Plants that are known and stable stay known.

        Raises InputError for a channel that the plants do not have, and as `Responses` does.
        """
        sizes = self.values.shape[2:]
        for name, number, size in zip(("output", "input"), (output, input), sizes, strict=True):
            if not 0 <= as_count(name, number) < size:
                raise InputError(f"{name} is {number}; the plants have {size}, numbered from 0")
        known = [minimal_realisation(plant[output, input]).lti for plant in self.known]
        return Responses(
            omega=self.omega,
            values=self.values[:, :, output, input],
            plants=self.plants,
            dt=self.dt,
            known=[plant if stability_check(plant).holds else None for plant in known],
        )

    @property
    def axis(self) -> RealArray:
        """Frequencies (F,) [rad/s]; for sampled systems those of the bilinear plane, in which they
        are fitted.
        """
        return np.asarray(bilinear_frequency(self.omega, self.dt))

    @property
    def shares(self) -> RealArray:
        """Share (F,) of each frequency in the band, on a logarithmic scale; their sum is 1."""
        if self.omega.size == 1:
            return np.ones(1)
        log = np.log(self.omega)
        width = np.gradient(log)
        found: RealArray = width / width.sum()
        return found

    def place(self, f: int) -> str:
        """Name of a frequency, for messages."""
        return f"{self.omega[f]:.6g} rad/s"

    def numbered(self, index: tuple[int, ...]) -> str:
        """Name of a frequency and a plant, for messages."""
        return f"plant {self.plants[index[1]]} at {self.place(index[0])}"


def system_response(system: StateSpace, omega: RealArray) -> Array:
    """Response (F, p, m) of a system at s = j omega, or at z = exp(j omega dt) if it is sampled."""
    s = np.exp(1j * omega * system.dt) if system.dt else 1j * omega
    M = np.block([[system.A, system.B], [system.C, system.D]])
    found: Array = frequency_response(M, system.nstates, s)
    return found
