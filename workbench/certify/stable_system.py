"""A system that is proven to be stable, in coordinates in which doubles can prove bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, RealArray
from workbench.certify.eigenvalues import Discs, pole_discs, separate_pole_discs
from workbench.certify.modes.enclosed_realisation import (
    Coordinates,
    GivenRealisation,
    in_continuous_time,
    in_coordinates,
    responds_sharply,
    scaled_states,
)
from workbench.certify.modes.modal_form import (
    MODAL_FORMS,
    Enclosures,
    FormOf,
    quick_modal_form_of,
)
from workbench.certify.modes.modal_response import (
    ModalResponse,
    modal_response,
    real_eigenvectors,
)
from workbench.certify.rounding import Enclosure
from workbench.errors import InputError
from workbench.input_checks import need_sampling_time
from workbench.systems.balancing import with_state_units
from workbench.systems.frequency_response import (
    CHUNK_ENTRIES,
    Triangular,
    driven_states,
    triangular_form,
    triangular_response,
)
from workbench.systems.hidden_states import seen_states
from workbench.systems.interconnection import named_realisation
from workbench.systems.joints import type_hint

SHARPNESS = 1e-6
"""A realisation is used as given if the radius of each pole's disc is below this share of the
pole's distance from the imaginary axis. Bounds 0.1 % above a resonance need discs that are smaller
than its damping by such a factor. Other realisations are transformed to modal coordinates in ball
arithmetic. Half or double: some realisations more or fewer are transformed.
"""
WELL_DAMPED = 0.1
"""With at least this damping ratio, discs up to a tenth of the distance from the axis are accepted.
A peak there is no more than five times its surroundings, so a bound stands above it without sharp
discs. Half or double transforms some more or fewer realisations.
"""
HALF_PI = np.pi / 2 * (1 - 1e-15)
"""Half-angle from which on a frequency counts as half the sampling rate."""
FEWEST_STATES, FEWEST_POINTS = 20, 4
"""Least number of states, and of frequencies, for which responses are computed from eigenvectors.
For fewer, elimination at each frequency is as fast. Half or double changes the time, and last bits.
"""


@dataclass(eq=False)
class Once:
    """A function without arguments, called once; unlike `functools.cache` it can be pickled."""

    make: Callable[[], StableSystem | None]

    def __call__(self) -> StableSystem | None:
        return self._made

    @cached_property
    def _made(self) -> StableSystem | None:
        return self.make()


@dataclass(frozen=True, eq=False)
class StableSystem:
    """A stable continuous-time system; ``poles`` (n,) [rad/s] are its computed poles.

    Unlike a `StateSpace`, it is known to be stable, and it keeps its poles and its distance
    from the given system for proofs.

    For a sampled system with ``period`` T [s], the response is at v = 2 / T tan(omega T / 2)
    (bilinear transformation, in balls). All methods take frequencies v, except `plane` and
    `angular`.

    ``A``, ``B``, ``C`` and ``D`` lie within ``errors`` of a realisation of the system, entry by
    entry. The errors are 0 if these are the given matrices with scaled states.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    poles: Array
    errors: tuple[RealArray, ...]
    modal: Callable[[], StableSystem | None] = lambda: None
    """Function that gives the system in modal coordinates, if ball arithmetic finds other
    coordinates than these.
    """
    source: GivenRealisation | None = None
    """The realisation as given; None if these matrices enclose many systems, as those around the
    centre of a box do.
    """
    period: float = 0.0
    """Sampling time [s] of the given system; 0: it is continuous."""

    def plane(self, omega: Any) -> Any:
        """v for frequencies omega [rad/s] of the given system."""
        return bilinear_frequency(omega, self.period)

    def angular(self, v: Any) -> Any:
        """Frequencies [rad/s] of the given system for v."""
        return angular_frequency(v, self.period)

    @property
    def enclosures(self) -> tuple[Enclosure, Enclosure, Enclosure, Enclosure]:
        """Enclosures of A, B, C and D."""
        A, B, C, D = self.errors
        return (
            Enclosure(self.A, A),
            Enclosure(self.B, B),
            Enclosure(self.C, C),
            Enclosure(self.D, D),
        )

    @property
    def condition(self) -> float:
        """Condition number of the eigenvectors of A."""
        return _condition(self.A)

    def vanishes(self) -> bool:
        """Whether the response is zero, exactly."""
        if self.source is not None:
            return self.source.vanishes()
        _, B, C, D = (part.mid.any() or part.rad.any() for part in self.enclosures)
        return not (D or (B and C))

    def summands(self, omega: ArrayLike) -> RealArray:
        """Sizes of the terms that add up to the response at frequencies [rad/s] (F, outputs,
        inputs).

        If the sum is zero in doubles, the response is known up to rounding of these terms.
        """
        points = np.asarray(omega, dtype=float)
        states = np.abs(driven_states(self.A, self.B, 1j * points[np.isfinite(points)]))
        sizes: RealArray = np.abs(self.D) + np.abs(self.C) @ states
        return sizes

    def channels(
        self,
        outputs: ArrayLike,
        inputs: ArrayLike,
        output_gains: ArrayLike = 1.0,
        input_gains: ArrayLike = 1.0,
    ) -> StableSystem:
        """The system with chosen outputs and inputs, by index, each times a gain."""
        outputs, inputs = np.asarray(outputs), np.asarray(inputs)
        rows, columns = (
            np.broadcast_to(np.asarray(gains, dtype=float), index.shape)
            for gains, index in ((output_gains, outputs), (input_gains, inputs))
        )
        A, B, C, D = self.enclosures
        B = B[:, inputs].times(columns)
        C = C[outputs].times(rows[:, None])
        D = D[outputs[:, None], inputs].times(columns).times(rows[:, None])

        def modal() -> StableSystem | None:
            found = self.modal()
            return found and found.channels(outputs, inputs, output_gains, input_gains)

        source = self.source and self.source.channels(outputs, inputs, rows, columns)
        return enclosed_system((A, B, C), D, self.poles, Once(modal), source, self.period)

    @property
    def scale(self) -> float:
        """Geometric mean of the sizes of the poles [rad/s]; 1 without poles."""
        return float(np.exp(np.log(np.abs(self.poles)).mean())) if len(self.poles) else 1.0

    def response(self, omega: ArrayLike, error: float | None = None) -> Array:
        """Frequency response at `omega` [rad/s] (F,), infinity allowed, (F, outputs, inputs).

        For many states and many frequencies, the error may be the share `error` of the largest
        entry of all, plus the rounding of an elimination: enough for norms. With None only rounding
        is allowed, as mu needs it, for which small entries may matter as much as large ones.
        """
        points = np.atleast_1d(np.asarray(omega, dtype=float))
        result = np.tile(self.D.astype(complex), (len(points), 1, 1))
        n = len(self.A)
        finite = np.flatnonzero(np.isfinite(points))
        many = finite.size >= FEWEST_POINTS
        if error is not None and many and n >= FEWEST_STATES and self._modal is not None:
            found = self._modal.at(1j * points[finite], error, of_largest=True)
            if found is not None:
                result[finite] += found
                return result
        step = max(CHUNK_ENTRIES // max(n * n, 1), 1)
        triangular = self._triangular if many else None
        for part in np.split(finite, range(step, len(finite), step)):
            if triangular is not None:
                result[part] += triangular_response(triangular, 1j * points[part])
                continue
            result[part] += self.C @ driven_states(self.A, self.B, 1j * points[part])
        return result

    @cached_property
    def _modal(self) -> ModalResponse | None:
        """The eigenvectors of A."""
        return modal_response(self.A, self.B, self.C)

    @cached_property
    def _triangular(self) -> Triangular | None:
        return triangular_form(self.A, self.B, self.C, self.poles)


def bilinear_frequency(omega: Any, period: float) -> Any:
    """v for frequencies omega [rad/s] of a system sampled every `period` [s]; 0: v is omega."""
    if not period:
        return omega
    half = np.asarray(omega, dtype=float) * period / 2.0
    with np.errstate(all="ignore"):
        v = np.where(half < HALF_PI, 2.0 / period * np.tan(half), np.inf)
    return v if v.ndim else float(v)


def angular_frequency(v: Any, period: float) -> Any:
    """Frequencies [rad/s] whose `bilinear_frequency` is v."""
    if not period:
        return v
    omega = 2.0 / period * np.arctan(np.asarray(v, dtype=float) * period / 2.0)
    return omega if omega.ndim else float(omega)


def stable_system(
    system: Any, *, sampled: bool = False, coordinates: Coordinates | None = None
) -> StableSystem:
    """The realisation of a StateSpace or TransferFunction that is proven to be stable.

    ``sampled`` says that the caller also takes sampled systems, and so knows of v. ``coordinates``
    proposes states in which bounds are easier to prove; the transformed matrices are enclosed, so
    that no proof rests on the proposal.

    The states are scaled; if doubles prove too little about the poles, modal states are used.
    States that, by zeros of the matrices, no input reaches or no output sees, are proven stable too
    and then left out: repeated poles of weights would only blur the others.

    Raises
    ------
    InputError
        The system has another type; it is improper or not finite, or sampled without ``sampled``;
        it has a pole on the imaginary axis or to the right of it; or its poles cannot be told from
        the axis.
    """
    if isinstance(system, StableSystem):
        return system
    import control

    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"a StateSpace or TransferFunction is needed, not {type(system).__name__}"
            f"{type_hint(system)}"
        )
    part = named_realisation(system)
    need_sampling_time(part.dt, "the system")
    if part.dt and not sampled:
        raise InputError(
            f"the system is sampled every {part.dt} s, but a continuous-time system is needed; the "
            "bilinear transformation keeps the values of the response, at other frequencies"
        )
    if not np.isfinite(part.M).all():
        raise InputError("the system has entries that are not finite")
    M, n = np.asarray(part.M, dtype=float), part.states
    seen = seen_states(M, n)
    period = float(part.dt or 0.0)
    own = GivenRealisation(
        *with_state_units(M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]), period=period
    )
    plain, D = in_continuous_time(own)
    parts = (coordinates and in_coordinates(own, coordinates)) or plain
    discs = pole_discs(parts[0])
    best, unstable = _relative_spread(discs), _is_unstable(discs)

    def in_modes(form_of: FormOf, bits: int) -> Enclosures | None:
        try:
            if form_of is quick_modal_form_of and not period:
                return scaled_states(form_of((own.A, own.B, own.C), bits))
            return scaled_states(form_of(own.in_balls(bits)[:3], bits))
        except ZeroDivisionError:
            return None

    for form_of, bits in MODAL_FORMS:
        if unstable or best <= (SHARPNESS if seen.all() else 1.0):
            break
        form = in_modes(form_of, bits)
        if form is not None:
            found = pole_discs(form[0])
            unstable = _is_unstable(found)
            if _relative_spread(found) < best:
                best, discs = _relative_spread(found), found
                parts = form if responds_sharply(form, plain) else parts
    if not (unstable or discs.rightmost < 0):
        discs = separate_pole_discs(plain[0])
        unstable = _is_unstable(discs)
    if unstable or not discs.rightmost < 0:
        raise _refusal(discs, plain[0].mid, unstable, period)
    if not seen.all():
        A, B, C = M[:n, :n][np.ix_(seen, seen)], M[:n, n:][seen], M[n:, :n][:, seen]
        rest = control.StateSpace(A, B, C, M[n:, n:], period, remove_useless_states=False)
        return stable_system(rest, sampled=sampled, coordinates=coordinates)
    poles = discs.centre.astype(complex)

    def modal() -> StableSystem | None:
        for (form_of, bits), spread in zip(MODAL_FORMS[:2], (SHARPNESS, 1.0), strict=True):
            form = in_modes(form_of, bits)
            if (
                form is not None
                and responds_sharply(form, plain)
                and _relative_spread(pole_discs(form[0])) < spread
            ):
                return enclosed_system(form, D, poles, source=own, period=period)
        return None

    return enclosed_system(parts, D, poles, Once(modal) if n else lambda: None, own, period)


def enclosed_system(
    parts: Enclosures,
    D: Enclosure,
    poles: Array,
    modal: Callable[[], StableSystem | None] = lambda: None,
    source: GivenRealisation | None = None,
    period: float = 0.0,
) -> StableSystem:
    """The stable system of the enclosed matrices."""
    every = (*parts, D)
    A, B, C, direct = (part.mid for part in every)
    errors = tuple(part.rad for part in every)
    return StableSystem(A, B, C, direct, poles, errors, modal, source, period)


def _relative_spread(discs: Discs) -> float:
    """Largest radius of a disc, as a share of its centre's distance from the axis; infinite right
    of the axis.

    Poles that are well damped may have larger discs: no bound stands close above a resonance there.
    """
    distance = -discs.centre.real
    with np.errstate(all="ignore"):
        share = np.where(distance > 0, discs.radius / distance, np.inf)
    damped = (distance > WELL_DAMPED * np.abs(discs.centre)) & (share < 0.1)
    return float(np.where(damped, SHARPNESS * share, share).max(initial=0.0))


def _is_unstable(discs: Discs) -> bool:
    """Whether a pole is proven to lie right of the imaginary axis."""
    return discs.proves_some(discs.centre.real > discs.radius)


def _condition(A: RealArray) -> float:
    """Condition number of the eigenvectors."""
    return float(np.linalg.cond(real_eigenvectors(A)[1])) if len(A) else 1.0


def _refusal(discs: Discs, A: RealArray, unstable: bool, period: float) -> InputError:
    """The error that says which pole is not stable, or why that cannot be decided."""
    place = int(np.argmax(discs.centre.real + np.where(np.isinf(discs.radius), 0, discs.radius)))
    pole = discs.centre[place]
    if unstable:
        place = int(np.argmax(discs.centre.real - discs.radius))
        pole = discs.centre[place]
    said = (
        "is unstable: it has the pole"
        if unstable
        else ("has a pole that cannot be told from the imaginary axis:")
    )
    if abs(pole.imag) <= np.finfo(float).eps * abs(pole.real):  # rounding
        pole = pole.real
    place_said = f"{pole:.6g} rad/s"
    if period:
        with np.errstate(all="ignore"):
            z = complex((2 / period + pole) / (2 / period - pole))
        place_said, said = f"z = {z:.9g}", said.replace("imaginary axis", "unit circle")
    return InputError(
        f"the system {said} {place_said}, and bounds over frequency mean "
        "nothing for it; close the loop with a stabilising controller, or move an "
        f"integrator a little {'into the circle' if period else 'to the left'}"
        + (
            ""
            if unstable
            else f" (the realisation's eigenvectors have condition {_condition(A):.1g}; a balanced "
            "or modal one may decide)"
        )
    )
