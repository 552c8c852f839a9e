"""H-infinity synthesis in one call."""

from __future__ import annotations

from typing import Any

from workbench.errors import InputError, SolverError
from workbench.solution import solve
from workbench.solvers import Options
from workbench.synthesis.families.family import Family
from workbench.synthesis.h_infinity.program import HinfController, HinfSynthesis
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant


def hinf(
    plant: Any,
    measurements: int | None = None,
    controls: int | None = None,
    *,
    gamma: float | None = None,
    order: int | None = None,
    family: Family | None = None,
    method: str | None = None,
    options: Options | None = None,
) -> HinfController:
    """The certified H-infinity controller u = K y (positive feedback) of a plant.

    A plant that does not meet an assumption is perturbed, less and less, until the norm of the loop
    settles. If weights have poles on the stability boundary, the controller is ``lti`` of the
    answer, and K is only a part of it.

    Parameters
    ----------
    plant
        `GeneralisedPlant`, or a StateSpace or TransferFunction whose last outputs are the
        measurements and whose last inputs are the controls.
    measurements, controls
        Numbers of measurements and controls, for a StateSpace or TransferFunction only. They stand
        in the order of python-control's ``hinfsyn(P, nmeas, ncon)``.
    gamma, order, family
        As in `HinfSynthesis`.
    method
        ``"riccati"`` (default), ``"sb10ad"``, the name of a conic solver, or ``"fixed"``, the
        default if an order or a family is given.

    Raises
    ------
    InputError
        As in `HinfSynthesis`; or the numbers are missing, or are given together with a
        GeneralisedPlant.
    SolverError
        No valid controller was found. The message says why; if gamma is too small, it gives the
        least level.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import hinf
    >>> B, C, D = [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    >>> P = control.ss([[-1.0]], B, C, D)
    >>> found = hinf(P, measurements=1, controls=1)
    >>> bool(found.norm < 1), found.K.nstates
    (True, 1)
    """
    import control

    if isinstance(plant, control.StateSpace | control.TransferFunction):
        if measurements is None or controls is None:
            raise InputError(
                f"a {type(plant).__name__} needs the numbers of measurements and controls"
            )
        plant = GeneralisedPlant(as_system(plant, "plant"), None, controls, measurements)
    elif measurements is not None or controls is not None:
        raise InputError(
            "measurements and controls belong to a StateSpace or TransferFunction; the plant is "
            f"{type(plant).__name__}"
        )
    solution = solve(
        HinfSynthesis(plant, gamma=gamma, order=order, family=family),
        method=method,
        options=options,
    )
    if solution.certificate is None:
        raise SolverError(solution.message)
    if not solution.certificate.valid:
        raise SolverError("; ".join(solution.certificate.failures))
    return solution.answer
