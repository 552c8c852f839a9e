"""Uncertainty models (a nominal with weights), and a test whether a model contains responses.

    multiplicative   G (1 + W_c delta_c + W_r delta_r)        (eq. 5.15 of the thesis)
    additive         G + W_c delta_c + W_r delta_r

with |delta_c| <= 1 complex and -1 <= delta_r <= 1 real. At every frequency the plants of the model
fill a circle or, with W_r, a stadium.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.answer import Answer
from workbench.certificate import Check, Checker
from workbench.certify.stable_system import bilinear_frequency
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.geometry import Stadium
from workbench.geometry.enclosing_shape import CONTAINMENT_TOLERANCE
from workbench.input_checks import need_choice, need_kind, need_whole
from workbench.structure import Complex as ComplexScalar
from workbench.structure import Real as RealScalar
from workbench.structure import Structure
from workbench.systems.connection import generalised_plant
from workbench.systems.conversion import as_system
from workbench.systems.frequency_grid import frequencies_of
from workbench.uncertainty.algebra.system import Algebraic
from workbench.uncertainty.covers.checks import realised_support
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.responses.plane import from_plane, plane_function
from workbench.uncertainty.responses.plants import Responses


@dataclass(frozen=True, eq=False)
class UncertaintyModel(Algebraic):
    """An uncertainty model: nominal, complex weight and, if the model is mixed, real weight.

    Unlike an `UncertainSystem`, it keeps its weights as functions, as covers find them.

    Parameters
    ----------
    nominal, W_c, W_r
        Each is a SISO system of python-control or a `Rational`; for a sampled model a `Rational` of
        the bilinear plane (see `workbench.uncertainty.responses.plane`). W_r = None gives circles.
    form
        ``"multiplicative"`` or ``"additive"``.
    dt
        Sampling time [s]; 0 for continuous time, None for that of the nominal.
    tested
        Results of tests on the records from which the model was identified, for certificates.
    measured
        Least and largest frequency [rad/s] of the responses from which the model was identified;
        None for a model that is stated.
    """

    nominal: Any  # all three are Rational after construction
    W_c: Any
    W_r: Any = None
    _: KW_ONLY
    form: CoverForm = "multiplicative"
    dt: Any = None  # it is a float after construction
    tested: tuple[str, ...] = field(default=(), kw_only=True)
    measured: tuple[float, float] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        need_choice(self.form, CoverForm, "form")
        for name in ("nominal", "W_c", "W_r"):
            given = getattr(self, name)
            if given is None and name != "W_r":
                raise InputError(f"{name} is needed; only W_r may be None")
            if given is None:
                continue
            if self.dt is None:
                own = None if isinstance(given, Rational) else as_system(given, name).dt
                object.__setattr__(self, "dt", float(own or 0.0))
            object.__setattr__(self, name, plane_function(given, name, self.dt))

    def __repr__(self) -> str:
        weights = " and ".join(
            f"{name} of order {part.order}"
            for name, part in (("W_c", self.W_c), ("W_r", self.W_r))
            if part is not None
        )
        right = int((self.nominal.poles.real > 0).sum())
        unstable = f", {right} poles right of the axis" if right else ""
        order = self.nominal.order
        kind = f"{self.form}, sampled every {self.dt:.6g} s" if self.dt else self.form
        return f"UncertaintyModel, {kind}: nominal of order {order}{unstable}; {weights}"

    @property
    def lti(self) -> StateSpace:
        """The nominal system."""
        import control

        return control.ss(from_plane(self.nominal, self.dt), inputs="u", outputs="f")

    @property
    def structure(self) -> Structure:
        """Blocks (delta_r, delta_c), in the order of eq. 6.3, or only delta_c."""
        complex_ = ComplexScalar(1, name="complex")
        if self.W_r is None:
            return Structure((complex_,))
        return Structure((RealScalar(1, name="real"), complex_))

    def systems(self) -> dict[str, StateSpace]:
        """``G``, ``W_c`` and, for a mixed model, ``W_r`` as python-control systems."""
        rationals = {"G": self.nominal, "W_c": self.W_c, "W_r": self.W_r}
        return {name: from_plane(r, self.dt) for name, r in rationals.items() if r is not None}

    @cached_property
    def system(self) -> StateSpace:
        """System with inputs (u_r, u_c, u) and outputs (y_r, y_c, f), to be closed with delta_r and
        delta_c.

        Without W_r there are no u_r and y_r. The perturbation acts at the input u of a
        multiplicative model, and at the output f of an additive model.
        """
        systems = self.systems()
        kinds = [kind for kind in ("r", "c") if f"W_{kind}" in systems]
        added = "".join(f" + u_{kind}" for kind in kinds)
        sums = (
            {"v": f"u{added}", "f": "g"}
            if self.form == "multiplicative"
            else {"v": "u", "f": f"g{added}"}
        )
        weights = [(systems[f"W_{kind}"], "u", f"y_{kind}") for kind in kinds]
        return generalised_plant(
            [(systems["G"], "v", "g"), *weights],
            sums,
            perturbation=[
                (block, f"y_{kind}", f"u_{kind}")
                for kind, block in zip(kinds, self.structure, strict=True)
            ],
            exogenous="u",
            performance="f",
        ).system

    def sizes(self, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Radius (F,) and half-length (F,) of the model's sets, in the units of the weights."""
        omega = bilinear_frequency(omega, self.dt)
        length = np.zeros(np.shape(omega)) if self.W_r is None else np.abs(self.W_r.response(omega))
        return np.abs(self.W_c.response(omega)), length

    def shapes(self, omega: RealArray) -> Stadium:
        """Sets of the model's plants at frequencies (F,) [rad/s], in the Nyquist plane."""
        omega = bilinear_frequency(omega, self.dt)
        nominal = self.nominal.response(omega)
        size = nominal if self.form == "multiplicative" else np.ones_like(nominal)
        radius = np.abs(size * self.W_c.response(omega))
        segment = np.zeros_like(nominal) if self.W_r is None else size * self.W_r.response(omega)
        return Stadium(nominal, radius, np.abs(segment), np.mod(np.angle(segment), np.pi))

    def plot(self) -> Figure:
        """The nominal's magnitude with that of all plants of the model, and the weights."""
        figure, (top, bottom) = figures.axes(2, 1, size=(7.0, 6.0), sharex=True)
        omega = frequencies_of(from_plane(self.nominal, self.dt))
        omega = omega[np.isfinite(bilinear_frequency(omega, self.dt))]
        frequency, sets = omega / (2 * np.pi), self.shapes(omega)
        reach = sets.radius + sets.half_length
        size = np.abs(sets.center)
        top.fill_between(
            frequency,
            np.maximum(size - reach, size / 100),
            size + reach,
            alpha=0.25,
            linewidth=0,
            label="plants of the model at most",
        )
        top.plot(frequency, size, label="nominal")
        radius, length = self.sizes(omega)
        bottom.plot(frequency, radius, color=figures.ORANGE, label="$|W_c|$")
        if self.W_r is not None:
            bottom.plot(frequency, length, color=figures.GREEN, label="$|W_r|$")
        figures.label(top, y="magnitude", log="y")
        figures.label(bottom, x="frequency [Hz]", y=f"weights, {self.form}", log="xy")
        for panel in (top, bottom):
            panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0))
        return figure


@dataclass(frozen=True, repr=False)
class Containment(Answer):
    """Answer to the question whether a model contains measured responses.

    ``excess`` (F,) is the largest distance of a point beyond its set, relative to the radius, and
    negative inside the set. If points may be left out, the most distant ones do not count.
    ``outside`` (F,) is the number of points outside, including these. ``where`` names the frequency
    of the largest excess.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, UncertaintyModel, contains
    >>> omega = np.geomspace(1, 100, 30)
    >>> plants = Responses(
    ...     omega=omega, values=np.array(
    ...         [gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]
    ...     ).T
    ... )
    >>> model = UncertaintyModel(control.tf([30.0], [1.0, 30.0]), control.tf([0.11], [1.0]))
    >>> found = contains(model, plants)
    >>> found.holds, bool(found.worst <= 0)
    (True, True)
    """

    excess: RealArray
    outside: np.ndarray
    where: str

    @property
    def worst(self) -> float:
        """Largest excess over all frequencies."""
        return float(self.excess.max())

    @property
    def holds(self) -> bool:
        """Whether the largest excess is within CONTAINMENT_TOLERANCE."""
        return self.worst <= CONTAINMENT_TOLERANCE

    @property
    def value(self) -> float:
        """The same as ``worst``."""
        return self.worst

    def __bool__(self) -> bool:
        return self.holds


@dataclass(frozen=True, eq=False)
class ContainmentChecker(Checker):
    """Checks a `Containment` with the model and the responses."""

    model: UncertaintyModel
    responses: Responses
    leave_out: int

    @property
    def quantifier(self) -> str:
        return self.responses.over

    def checks(self, answer: Containment, tolerance: float) -> list[Check]:
        found = contains(self.model, self.responses, leave_out=self.leave_out)
        statement = "largest distance of a point beyond its set, over the radius"
        limit = CONTAINMENT_TOLERANCE
        return [
            Check("containment", statement, found.worst, limit, where=found.where),
            Check("claim", "how much larger it is than claimed", found.worst - answer.worst, limit),
        ]

    def second_opinion(self, answer: Containment) -> list[Check]:
        model = self.model
        return [realised_support(model.systems(), model.form, self.responses, self.leave_out)]


def contains(model: UncertaintyModel, responses: Responses, *, leave_out: int = 0) -> Containment:
    """Test whether every response lies in the model's set at its frequency.

    The test uses only the roots and the data. It is computed in extended precision by code that the
    construction of covers does not use.

    Parameters
    ----------
    leave_out
        Number of points that may lie outside at each frequency.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, UncertaintyModel, contains
    >>> omega = np.geomspace(1, 100, 30)
    >>> plants = Responses(
    ...     omega=omega, values=np.array(
    ...         [gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]
    ...     ).T
    ... )
    >>> model = UncertaintyModel(control.tf([30.0], [1.0, 30.0]), control.tf([0.11], [1.0]))
    >>> narrow = UncertaintyModel(control.tf([30.0], [1.0, 30.0]), control.tf([0.09], [1.0]))
    >>> contains(model, plants).holds, contains(narrow, plants).holds
    (True, False)
    """
    need_kind(model, UncertaintyModel, "model")
    need_kind(responses, Responses, "responses")
    need_whole(leave_out, "leave_out")
    if not 0 <= leave_out < responses.values.shape[1]:
        plants = responses.values.shape[1]
        raise InputError(f"leave_out is {leave_out}; it must be from 0 to {plants - 1}")
    s = 1j * responses.axis.astype(np.longdouble)
    nominal = _value(model.nominal, s)
    size = nominal if model.form == "multiplicative" else np.ones_like(nominal)
    radius = np.abs(size * _value(model.W_c, s))[:, None]
    away = responses.values.astype(np.clongdouble) - nominal[:, None]
    if model.W_r is not None:
        segment = (size * _value(model.W_r, s))[:, None]
        square = np.maximum(np.abs(segment) ** 2, np.finfo(np.longdouble).tiny)
        along = np.clip((away * segment.conj()).real / square, -1, 1)
        away = away - along * segment
    with np.errstate(all="ignore"):
        excess = np.where(responses.present, np.abs(away) / radius - 1, -np.inf).astype(float)
    ordered = np.sort(np.where(np.isnan(excess), np.inf, excess), axis=1)
    worst = ordered[:, -1 - leave_out]
    place = f"at {responses.place(int(worst.argmax()))}"
    found = Containment(worst, (excess > CONTAINMENT_TOLERANCE).sum(axis=1), place)
    return found.with_checker(ContainmentChecker(model, responses, leave_out))


def _value(rational: Rational, s: np.ndarray) -> np.ndarray:
    """Value of a function at s, by sums of logarithms, so that no product overflows."""
    logs = np.log(s[:, None] - rational.zeros.astype(np.clongdouble)).sum(axis=1)
    logs = logs - np.log(s[:, None] - rational.poles.astype(np.clongdouble)).sum(axis=1)
    value: np.ndarray = rational.gain * np.exp(logs)
    return value
