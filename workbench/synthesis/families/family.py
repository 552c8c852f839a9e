"""Families of controllers with a fixed structure and few real parameters.

The parameters are free real numbers. They are scaled so that steps of the same size have similar
effects everywhere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import as_array, is_real, need_whole
from workbench.synthesis.families.least_squares import fitted_parameters
from workbench.systems.bilinear import from_continuous_plane, in_continuous_plane
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import Matrices, matrices_of

LARGEST_LOG = 100.0
"""Largest magnitude of a parameter that is a logarithm, so that products do not overflow."""
POLE_ROOM = 1e-6
"""Poles keep this distance from the largest allowed size, relative to that size."""


class Family(ABC):
    """Controllers u = K(s; x) y with p outputs and m inputs and real parameters x.

    A user's own family must define `system`, `response` and `parameters`. If it also defines
    `examples`, methods find their own starts in it.

    Examples
    --------
    >>> from workbench.synthesis import PID, Family
    >>> family, x = PID.of(2.0, 1.0, 0.1, 0.01)
    >>> isinstance(family, Family), x.shape
    (True, (4,))
    """

    @abstractmethod
    def system(self, x: RealArray) -> StateSpace:
        """The controller with parameters x (k,)."""

    def matrices(self, x: RealArray) -> Matrices:
        """A, B, C and D of the controller with parameters x (k,)."""
        return matrices_of(self.system(x))

    @abstractmethod
    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        """K (F, p, m) at omega (F,) [rad/s], and its derivatives (F, k, p, m) by x."""

    @abstractmethod
    def parameters(self, controller: StateSpace) -> RealArray:
        """Parameters (k,) of a member of the family; raises InputError for other controllers."""

    def units(self, x: RealArray) -> RealArray:
        """Units of steps (k,): the size of each parameter, or a tenth of the median size if that is
        larger.

        Zero where all parameters are about zero, since their sizes then give no unit.
        """
        size = np.abs(x)
        return np.maximum(size, 0.1 * float(np.median(size)))

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        """G (r, k) and h (r,): controllers whose parameters satisfy G x <= h meet the demands on
        poles.

        There are no rows if a family has no such inequalities. Its members are then only checked.
        """
        return np.zeros((0, self.count or 0)), np.zeros(0)

    def about(self, controller: StateSpace) -> tuple[Family, RealArray]:
        """The family with parameters scaled to suit a member, and the member's parameters (k,).

        Raises InputError for other controllers.
        """
        return self, self.parameters(controller)

    def sized(self, inputs: int, outputs: int) -> Family:
        """The family for a plant with so many measurements and controls.

        Raises InputError if the family has other numbers of inputs or outputs.
        """
        return self

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        """Members from which searches start: corners near omega [rad/s], gains far below `gain`.

        Empty if a family has no examples; a search then needs a start.
        """
        return ()

    @property
    def count(self) -> int | None:
        """Number of parameters; None if the family does not say."""
        return None

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """The member nearest to a controller, by the sum of squares of weight (F,) times distance.

        `omega` are frequencies (F,) [rad/s]. Returns None if no member is found. Families that are
        not linear in their parameters descend from their `examples` to a local optimum.
        """
        wanted = response(controller, omega)
        corner = float(np.exp(np.average(np.log(omega), weights=weight / weight.max())))
        gain = float(np.average(np.abs(wanted).max(axis=(1, 2)), weights=weight))
        found: list[tuple[float, int, StateSpace]] = []
        for example in self.examples(corner, gain):
            family, x = self.about(example)
            best, miss = fitted_parameters(family.response, x, wanted, omega, weight)
            found.append((miss, len(found), family.system(best)))
        return min(found)[2] if found else None

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        """Settings of a member as engineers know them, by name with unit; empty if the family has
        none.

        Raises InputError for other controllers.
        """
        return {}


def need_size(family: Family, has: tuple[int, int], inputs: int, outputs: int, do: str) -> None:
    """Raise InputError unless a family with ``has`` inputs and outputs fits a plant."""
    if has != (inputs, outputs):
        raise InputError(
            f"{family} has {has[0]} inputs and {has[1]} outputs, the plant {inputs} measurements "
            f"and {outputs} controls: {do}"
        )


def need_leak(leak: Any) -> None:
    """Raise InputError unless the leak of an integrator is a number of at least 0."""
    if not (is_real(leak) and 0.0 <= leak < np.inf):
        raise InputError(f"leak is {leak!r}; it must be a number of rad/s, 0 or more")


def need_family(family: Any, name: str) -> None:
    """Raise InputError for anything that is not a family; the message says how a family is
    given.
    """
    if isinstance(family, Family):
        return
    if isinstance(family, type) and issubclass(family, Family):
        raise InputError(f"{name} is the class {family.__name__}: write {family.__name__}()")
    if isinstance(family, tuple) and family and isinstance(family[0], Family):
        raise InputError(
            f"{name} is a tuple of a family and parameters: give the first as the family, and "
            "the second as start"
        )
    raise InputError(
        f"{name} must be a Family, not {type(family).__name__}: PID(), PI(), PD(), LeadLag(), "
        "Static(), Modal(order), Decentralised(PID(), PI()), Sparse(rows), ObserverForm(model) or "
        "Parametrised(matrices, near)"
    )


def family_for(family: Any, plant: GeneralisedPlant) -> Family:
    """The family, adapted to the measurements and controls of a plant.

    Raises InputError for anything that is not a family or does not fit.
    """
    need_family(family, "family")
    sized: Family = family.sized(plant.measurements, plant.controls)
    return sized


def need_continuous_plant(program: Any) -> None:
    """Raise InputError if the plant is sampled but a demand is for continuous controllers."""
    dt, integral = program.plant.system.dt, getattr(program, "integral", False)
    if dt and (program.fastest_pole is not None or integral):
        raise InputError(
            f"the plant is sampled (dt = {dt} s): fastest_pole and integral are for continuous "
            "controllers"
        )


def asked_of(program: Any) -> list[str]:
    """Names of a synthesis' demands on the controller itself."""
    names = ("start", "family", "order", "fastest_pole", "largest_gain")
    asked = [name for name in names if getattr(program, name) is not None]
    flags = ("stable", "integral", "further_plants")
    return [*asked, *(name for name in flags if getattr(program, name, False))]


def need_draws(random: Any) -> None:
    """Raise InputError unless the number of random members is 0 or more."""
    need_whole(random, "random")
    if random < 0:
        raise InputError(f"random is {random}; it must be 0 or more")


def need_form_for_all(program: Any) -> None:
    """Raise InputError if there are several plants but no order, family or start of the
    controller.
    """
    told = (program.family, program.order, program.start)
    if program.further_plants and all(each is None for each in told):
        raise InputError(
            "further_plants need order, family or start: the search for one controller of "
            "several plants needs its form"
        )


def started(family: Family | None, start: Any, plants: Sequence[GeneralisedPlant]) -> StateSpace:
    """The start as a system; it is given as a system or by its parameters in a family.

    Raises InputError for a wrong number of parameters, for a system that is no member of the
    family, and for a start that does not stabilise all plants.
    """
    K = _as_member(family, start, float(plants[0].system.dt or 0.0))
    for number, plant in enumerate(plants):
        stability = stability_check(plant.close(K))
        if stability.holds:
            continue
        which = f"further plant {number}" if number else "the plant"
        raise InputError(
            f"the start does not stabilise {which}: the loop has a pole with real part "
            f"{stability.value:.3g} {stability.where}, which must be less than "
            f"{stability.limit:.3g}, its rounding error"
        )
    return K


def _as_member(family: Family | None, start: Any, dt: float) -> StateSpace:
    """The start as a system with the sampling time `dt` [s], 0 for continuous time.

    Raises InputError for a system that is no member of the family.
    """
    if family is None or isinstance(start, str) or np.ndim(start) != 1:
        K = as_system(start, "start")
        if float(K.dt or 0.0) != dt:
            raise InputError(
                f"start has dt = {float(K.dt or 0.0)} s, the plant {dt} s; 0 is continuous time"
            )
        if family is not None:
            family.about(in_continuous_plane(K))  # raises InputError for a system that is no member
        return K
    x, count = as_array(start, "start"), family.count
    if count is not None and len(x) != count:
        raise InputError(f"start has {len(x)} numbers; a member of {family} has {count} parameters")
    if not np.isfinite(x).all():
        raise InputError(f"start is {x.tolist()}; parameters must be finite")
    return from_continuous_plane(family.system(x), dt)
