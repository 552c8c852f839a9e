"""Plants with faults, whose inputs are controls, disturbances, faults and noise.

Thesis, equation 7.5: x' = A x + B u + R1 f, y = C x + D u + R2 f. An actuator fault enters where
its control does, a sensor fault at its output, a process fault by R1 and R2 of its own. A
multiplicative fault, a parameter that changes by delta, adds delta dM [x; u] to [x'; y]
(equation 7.2). With dM = L R of full rank this is exactly the additive fault f = delta R [x; u],
which enters by the columns of L; but f depends on x and u then and is no free signal. The linear
fractional transformation of `multiplicative_lft` keeps that dependence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.models.rank_factors import rank_factors
from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import as_array, need_sampling_time
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

KINDS = ("controls", "disturbances", "faults", "noise")
"""Kinds of inputs."""


@dataclass(frozen=True, eq=False)
class FaultModel:
    """A system with named inputs, each a control, a disturbance, a fault or noise.

    Unlike a `StateSpace`, it says which inputs are controls, disturbances, faults and noise.

    Residuals are to be decoupled from disturbances exactly; the effect of noise on them is only to
    be small.

    Parameters
    ----------
    system
        StateSpace, continuous or sampled, with named inputs; its outputs are the measurements.
    controls, disturbances, faults, noise
        Names of the system's inputs, each in one of the four.

    Raises
    ------
    InputError
        The system is no StateSpace, has no output, entries that are not finite or an unknown
        sampling time; an input is in two groups or in none.
    UnknownNameError
        A name is not that of an input of the system.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import FaultModel
    >>> A, B = [[-1.0, 0.0], [0.0, -2.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]
    >>> plant = control.ss(A, B, np.eye(2), 0.0, inputs=["u", "d", "f"], outputs=["y1", "y2"])
    >>> model = FaultModel(plant, controls=("u",), disturbances=("d",), faults=("f",))
    >>> model.outputs, model.response(["f"], [0.0]).real.ravel().tolist()
    (('y1', 'y2'), [1.0, 0.5])
    """

    system: StateSpace
    _: KW_ONLY
    controls: tuple[str, ...] = ()
    disturbances: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    noise: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _need_system(self.system)
        inputs = list(self.system.input_labels)
        place: dict[str, str] = {}
        for kind in KINDS:
            given = getattr(self, kind)
            try:
                names = (given,) if isinstance(given, str) else tuple(given)
            except TypeError:
                raise InputError(f"{kind} are {given!r}; names of inputs are needed") from None
            object.__setattr__(self, kind, names)
            for name in names:
                if name not in inputs:
                    raise UnknownNameError("input", name, inputs)
                if name in place:
                    raise InputError(
                        f"input {name!r} stands in {place[name]} and in {kind}; it can be in one"
                    )
                place[name] = kind
        missing = [name for name in inputs if name not in place]
        if missing:
            raise InputError(
                f"inputs {', '.join(missing)} are neither controls nor disturbances, faults or "
                "noise; name each in one of the four"
            )

    # --- parts of the model -------------------------------------------------------------------

    @property
    def dt(self) -> float:
        """Sampling time [s]; 0 for a continuous system."""
        return float(self.system.dt or 0.0)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the measured outputs."""
        return tuple(self.system.output_labels)

    def columns(self, names: Sequence[str]) -> list[int]:
        """The numbers of the named inputs; raises UnknownNameError for a name that is no input."""
        inputs = list(self.system.input_labels)
        if isinstance(names, str) or not isinstance(names, Sequence):
            raise InputError(f"names are {names!r}; a list of names of inputs is needed")
        for name in names:
            if name not in inputs:
                raise UnknownNameError("input", name, inputs)
        return [inputs.index(name) for name in names]

    def matrices(self, names: Sequence[str]) -> tuple[Array, Array]:
        """B (n, k) and D (p, k) of the k named inputs."""
        places = self.columns(names)
        return np.asarray(self.system.B)[:, places], np.asarray(self.system.D)[:, places]

    def response(self, names: Sequence[str], omega: ArrayLike) -> Array:
        """The response (F, p, k) from k inputs to the outputs at `omega` [rad/s] (F,).

        Raises InputError at a pole, and for frequencies that are not finite.
        """
        at = as_array(omega, "omega").reshape(-1)
        if not np.isfinite(at).all():
            raise InputError(f"omega is {omega!r}; finite frequencies [rad/s] are needed")
        return response(self.system, at)[:, :, self.columns(names)]

    # --- faults -------------------------------------------------------------------------------

    def with_fault(self, name: str, R1: ArrayLike, *, R2: ArrayLike | None = None) -> FaultModel:
        """The model with a process fault that enters the states by R1 (n,), the outputs by R2 (p,).

        Raises InputError for another shape, entries that are not finite, R1 and R2 both zero, or a
        name that is taken.
        """
        p = len(self.outputs)
        if not isinstance(name, str):
            raise InputError(f"the fault's name is {name!r}; it must be a string")
        entry = as_array(R1, f"R1 of fault {name!r}").reshape(-1)
        through = np.zeros(p)
        if R2 is not None:
            through = as_array(R2, f"R2 of fault {name!r}").reshape(-1)
        n = int(self.system.nstates)
        if entry.shape != (n,) or through.shape != (p,):
            raise InputError(
                f"fault {name!r} has R1 with {entry.size} and R2 with {through.size} entries; the "
                f"system has {n} states and {p} outputs"
            )
        if not (np.isfinite(entry).all() and np.isfinite(through).all()):
            raise InputError(f"R1 or R2 of fault {name!r} has entries that are not finite")
        if not (entry.any() or through.any()):
            raise InputError(f"fault {name!r} enters nowhere: R1 and R2 are zero")
        if name in self.system.input_labels:
            raise InputError(f"the system already has an input {name!r}; give the fault another")
        system = self.system
        larger = realisation(
            (
                system.A,
                np.column_stack([system.B, entry]),
                system.C,
                np.column_stack([system.D, through]),
            ),
            self.dt,
            inputs=[*system.input_labels, name],
            outputs=list(self.outputs),
        )
        return FaultModel(
            larger,
            controls=self.controls,
            disturbances=self.disturbances,
            faults=(*self.faults, name),
            noise=self.noise,
        )

    def with_actuator_faults(self, *controls: str) -> FaultModel:
        """The model with an actuator fault ``f_<control>`` of each named control, or of all."""
        model = self
        for name in controls or self.controls:
            if name not in self.controls:
                raise UnknownNameError("control", name, self.controls)
            B, D = self.matrices([name])
            model = model.with_fault(f"f_{name}", B, R2=D)
        return model

    def with_sensor_faults(self, *outputs: str) -> FaultModel:
        """The model with a sensor fault ``f_<output>`` at each named output, or at all."""
        model = self
        for name in outputs or self.outputs:
            if name not in self.outputs:
                raise UnknownNameError("output", name, self.outputs)
            R2 = np.eye(len(self.outputs))[self.outputs.index(name)]
            model = model.with_fault(f"f_{name}", np.zeros(self.system.nstates), R2=R2)
        return model

    def with_multiplicative_fault(
        self,
        name: str,
        *,
        dA: ArrayLike | None = None,
        dB: ArrayLike | None = None,
        dC: ArrayLike | None = None,
        dD: ArrayLike | None = None,
    ) -> FaultModel:
        """The model with a parameter fault: as many additive inputs as [dA dB; dC dD] has rank.

        If the model is not affine in the parameter, give the derivatives of its matrices at the
        nominal value; the fault is then right to first order. The input is called `name`; several
        are called ``<name>_1`` and so on. The matrices have the shapes of A, of B of the controls,
        of C and of D of the controls.

        Raises
        ------
        InputError
            A matrix has another shape or entries that are not finite; all are zero; the name is
            taken.
        """
        n = int(self.system.nstates)
        sizes = n, len(self.outputs), len(self.controls)
        left, _ = rank_factors(name, (dA, dB, dC, dD), *sizes)
        rank = left.shape[1]
        model = self
        for k, column in enumerate(left.T):
            each = name if rank == 1 else f"{name}_{k + 1}"
            model = model.with_fault(each, column[:n], R2=column[n:])
        return model


def _need_system(system: Any) -> None:
    import control

    if not isinstance(system, control.StateSpace):
        raise InputError(
            f"system must be a StateSpace, not {type(system).__name__}; control.ss converts a "
            "TransferFunction"
        )
    if not system.noutputs:
        raise InputError("the system has no output: nothing is measured")
    need_sampling_time(system.dt, "the system")
    for part in "ABCD":
        if not np.isfinite(getattr(system, part)).all():
            raise InputError(f"{part} of the system has entries that are not finite")
