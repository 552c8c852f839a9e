"""Robust performance of a plant closed by a controller: the peak of mu, and mu over frequency."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from workbench.certify.stability import stability_check
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.frequency.sweep import Sweep, frequency_sweep
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant


def performance_peak(
    plant: GeneralisedPlant, controller: Any, *, tolerance: float = 1e-3
) -> Peak | None:
    """The certified supremum of mu of robust performance; None for an unstable nominal loop.

    `conditions` computes the other three conditions too. For a part of the performance channels
    take `plant.channel` first.

    Parameters
    ----------
    plant
        A `GeneralisedPlant` with performance outputs and exogenous inputs, closed by a full block.
        Without a perturbation the peak is that of the largest singular value.
    controller
        StateSpace or TransferFunction, from the plant's measurements to its controls.
    tolerance
        Relative width of the interval that certifies the peak, as of `peak`.

    Raises
    ------
    InputError
        The plant is no GeneralisedPlant or has no performance channel; or as
        `GeneralisedPlant.close` and `peak`.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import performance_peak
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> found = performance_peak(plant, K)
    >>> bool(found.lower <= found.upper < 1)
    True
    """
    need_plant(plant)
    loop = plant.close(controller)
    if not stability_check(loop).holds:
        return None
    return peak(loop, plant.performance_structure, tolerance=tolerance)


def performance_sweep(plant: GeneralisedPlant, controller: Any, omega: ArrayLike) -> Sweep:
    """Bounds of mu of robust performance at frequencies `omega` [rad/s] (F,).

    The bounds mean nothing if the nominal loop is unstable: call `performance_peak` first.

    Raises InputError as `performance_peak`, and `frequency_sweep` for the frequencies.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import performance_sweep
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> performance_sweep(plant, K, [0.1, 1.0, 10.0]).upper.shape
    (3,)
    """
    need_plant(plant)
    return frequency_sweep(plant.close(controller), plant.performance_structure, omega=omega)
