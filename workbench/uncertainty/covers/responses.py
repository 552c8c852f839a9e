"""Responses of several plants on one grid of frequencies, the data of every cover."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.fitting.rational import Rational, from_system
from workbench.heavy_types import DataArray, FrequencyResponseData
from workbench.systems.frequency_grid import starting_grid

KNOWN_RESPONSE_TOLERANCE = 1e-6
"""Largest distance of a given response from that of the known plant, relative to it."""


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured or computed responses of N >= 2 plants at F >= 2 frequencies.

    Parameters
    ----------
    omega
        Angular frequencies [rad/s], increasing, positive, shape (F,).
    values
        Complex responses, shape (F, N); finite and not zero where present.
    present
        Which responses were measured, booleans of shape (F, N); None: all. At least two plants are
        needed at every frequency.
    plants
        Names of the N plants; None: they are numbered.
    unit
        Unit of the responses, for labels.
    assumption
        Assumption that the set makes beyond the measured points, for instance a distribution; see
        `workbench.uncertainty.widened`. It stands in the certificates of covers.
    known
        The N plants as systems, where they are known at every frequency: stable SISO systems of
        python-control or `Rational`s, None for a plant that was only measured. Covers contain
        these at every frequency, between the given ones too.

    Raises
    ------
    InputError
        Data other than these, or a known plant that is unstable or has other responses; the
        message names the plant and the frequency.
    """

    omega: RealArray
    values: ComplexArray
    present: Any = None  # an ndarray after construction
    plants: Any = None  # a tuple of names after construction
    unit: str = field(default="1", kw_only=True)
    assumption: str = field(default="", kw_only=True)
    known: Any = field(default=None, kw_only=True)  # a tuple of Rational or None, or () for none

    def __post_init__(self) -> None:
        omega = np.asarray(self.omega, dtype=float)
        if omega.ndim != 1 or omega.size < 2:
            raise InputError(
                f"omega of shape {omega.shape}: two frequencies or more are needed, shape (F,)"
            )
        bad = ~(np.isfinite(omega) & (omega > 0))
        if bad.any():
            raise InputError(f"omega[{bad.argmax()}] is {omega[bad.argmax()]}; it must be positive")
        steps = np.diff(omega) <= 0
        if steps.any():
            k = int(steps.argmax())
            kind = "repeated" if omega[k] == omega[k + 1] else "not increasing"
            raise InputError(
                f"omega[{k}] = {omega[k]:.6g} and omega[{k + 1}] = {omega[k + 1]:.6g} rad/s are "
                f"{kind}: sort the frequencies and keep each once"
            )
        values = np.asarray(self.values)
        if values.dtype.kind not in "iufc":
            raise InputError(f"responses must be numbers, they have type {values.dtype}")
        if values.ndim != 2 or len(values) != omega.size:
            raise InputError(
                f"responses of shape {values.shape} do not fit {omega.size} frequencies; "
                "needed is (F, N), a column for each plant"
            )
        if values.shape[1] < 2:
            raise InputError("one plant has no spread to cover: two or more are needed")
        present = np.ones(values.shape, bool) if self.present is None else np.array(self.present)
        if present.shape != values.shape or present.dtype != bool:
            raise InputError(f"present must be booleans of shape {values.shape}")
        plants = tuple(
            map(str, range(1, values.shape[1] + 1)) if self.plants is None else self.plants
        )
        if len(plants) != values.shape[1]:
            raise InputError(f"{len(plants)} names for {values.shape[1]} plants")
        object.__setattr__(self, "omega", omega)
        object.__setattr__(self, "values", values.astype(complex))
        object.__setattr__(self, "present", present)
        object.__setattr__(self, "plants", plants)
        self._refuse(~np.isfinite(values), "is not finite")
        self._refuse(values == 0, "is exactly zero")
        few = present.sum(axis=1) < 2
        if few.any():
            raise InputError(
                f"only {present[few.argmax()].sum()} plant was measured at "
                f"{self.place(int(few.argmax()))}: two or more are needed at every frequency"
            )
        object.__setattr__(self, "known", self._checked(tuple(self.known or ())))

    def _checked(self, known: tuple[Any, ...]) -> tuple[Rational | None, ...]:
        """The known plants as functions; raises `InputError` for those that cannot be."""
        if known and len(known) != len(self.plants):
            raise InputError(f"{len(known)} known systems for {len(self.plants)} plants")
        found = tuple(
            plant if plant is None or isinstance(plant, Rational) else from_system(plant)
            for plant in known
        )
        for i, plant in enumerate(found):
            if plant is None:
                continue
            if not plant.is_stable:
                raise InputError(
                    f"plant {self.plants[i]} is unstable, its poles are {plant.poles}: no set of a "
                    "stable nominal and stable weights contains it"
                )
            apart = np.abs(plant.response(self.omega) / self.values[:, i] - 1)
            apart = np.where(self.present[:, i], apart, 0.0)
            k = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
            if not apart[k] <= KNOWN_RESPONSE_TOLERANCE:
                raise InputError(
                    f"the known plant {self.plants[i]} has another response at {self.place(k)}: "
                    f"it is {apart[k]:.3g} off, relative"
                )
        return found

    @property
    def known_plants(self) -> dict[str, Rational]:
        """The plants that are known at every frequency, by name."""
        pairs = zip(self.plants, self.known, strict=False)
        return {name: plant for name, plant in pairs if plant is not None}

    @property
    def over(self) -> str:
        """What a statement about these responses quantifies over."""
        return f"at the {self.omega.size} given frequencies, for these {len(self.plants)} plants"

    def _refuse(self, bad: np.ndarray, what: str) -> None:
        """Raise `InputError` if a measured response is bad; it names the first one."""
        bad = bad & self.present
        if bad.any():
            k, i = (int(j) for j in np.argwhere(bad)[0])
            raise InputError(
                f"the response of plant {self.plants[i]} {what} at {self.place(k)}; "
                "mark what was not measured with present=False"
            )

    @property
    def frequency(self) -> RealArray:
        """Frequencies (F,) [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def shares(self) -> RealArray:
        """Share (F,) of each frequency in the logarithmic frequency axis; their sum is 1."""
        width = np.gradient(np.log(self.omega))
        return width / width.sum()

    def thinned(self, most: int) -> Responses:
        """The same plants at ``most`` of the frequencies at most, with the first and the last."""
        if self.omega.size <= most:
            return self
        chosen = np.unique(np.linspace(0, self.omega.size - 1, most).round().astype(int))
        return replace(
            self,
            omega=self.omega[chosen],
            values=self.values[chosen],
            present=self.present[chosen],
        )

    def refined(self) -> Responses:
        """The same plants with further frequencies of the band, at which resonances show.

        Where a plant was only measured nothing is known between the frequencies: they stay.
        """
        if not self.known or None in self.known:
            return self
        poles = np.concatenate([plant.poles for plant in self.known])
        more = starting_grid(poles)
        more = more[(more > self.omega[0]) & (more < self.omega[-1])]
        omega = np.union1d(self.omega, more)
        values = np.stack([plant.response(omega) for plant in self.known], axis=1)
        given = np.searchsorted(omega, self.omega)
        values[given] = np.where(self.present, self.values, values[given])
        present = np.ones(values.shape, bool)
        present[given] = self.present
        return replace(self, omega=omega, values=values, present=present)

    def place(self, index: int) -> str:
        """A frequency, for messages."""
        return f"{self.omega[index] / (2 * np.pi):.6g} Hz"

    @property
    def points(self) -> ComplexArray:
        """Point sets (F, N); a missing point is replaced by another point of its set."""
        return filled(self.values, self.present)

    def labelled(self) -> DataArray:
        """The point sets with names and units, dims (frequency, plant)."""
        import xarray as xr

        axis = {"units": "Hz", "long_name": "frequency"}
        return xr.DataArray(
            self.points,
            dims=("frequency", "plant"),
            coords={"frequency": ("frequency", self.frequency, axis), "plant": list(self.plants)},
            attrs={"units": self.unit, "long_name": "response"},
        )


def filled(values: ComplexArray, present: np.ndarray) -> ComplexArray:
    """Values (F, N), each missing value replaced by the first measured one at its frequency."""
    substitute = values[np.arange(len(values)), present.argmax(axis=1)]
    points: ComplexArray = np.where(present, values, substitute[:, None])
    return points


def responses_of(systems: Sequence[FrequencyResponseData], **names: Any) -> Responses:
    """Responses of SISO plants that were each measured at their own frequencies.

    The grid is the union of all frequencies; a plant counts as missing where it was not measured.

    Parameters
    ----------
    systems
        `control.FrequencyResponseData` objects, frequencies in rad/s.
    names
        ``plants``, ``unit``, ``assumption`` and ``known`` of `Responses`.

    Raises
    ------
    InputError
        The same as for `Responses`; in particular plants on different grids leave a frequency with
        fewer than two of them.
    """
    for k, system in enumerate(systems):
        if not hasattr(system, "frdata"):
            kind = type(system).__name__
            raise InputError(f"plant {k + 1} is no frequency response, but a {kind}")
        if (system.ninputs, system.noutputs) != (1, 1):
            raise InputError(f"plant {k + 1} is {system.noutputs} x {system.ninputs}, not SISO")
    grids = [np.asarray(system.omega, dtype=float) for system in systems]
    omega = np.unique(np.concatenate(grids)) if grids else np.zeros(0)
    values = np.full((omega.size, len(grids)), np.nan, dtype=complex)
    for k, (grid, system) in enumerate(zip(grids, systems, strict=True)):
        values[np.searchsorted(omega, grid), k] = np.asarray(system.frdata)[0, 0]
    present = np.zeros(values.shape, bool)
    for k, grid in enumerate(grids):
        present[np.searchsorted(omega, grid), k] = True
    lonely = present.sum(axis=1) < 2 if grids else np.zeros(0, bool)
    if lonely.any():
        raise InputError(
            f"the plants were measured on different grids: {lonely.sum()} of {omega.size} "
            "frequencies have one plant only, the first at "
            f"{omega[lonely][0] / (2 * np.pi):.6g} Hz; "
            "measure on common frequencies, or interpolate before"
        )
    return Responses(omega, values, present, **names)
