"""Joint search for nominal and weights that make the sets of a model small.

Near a resonance that differs from plant to plant, no curve of low order passes through the centres
of the smallest shapes, and no weight of low order follows the radii around a nominal. So nominal,
real weight and complex weight are chosen together to minimise the size of the model's sets. The
cost is the mean over log frequency of

    circles     |W_c|^2
    stadiums    |W_c|^2 + HALF_LENGTH_WEIGHT |W_r|^2

where W_c reaches the largest distance of a deviation from the nominal, or from the segment of the
real weight. Sizes are relative to the nominal or, for additive models, to the plants. Nothing is
known outside the range of frequencies. There the squares of both weights have a small weight in the
cost, since otherwise they could grow without limit at zero frequency, and W_c is not smaller than
at the ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.fitting.reach import within_reach
from workbench.fitting.root_pairs import pair_logarithms
from workbench.uncertainty.covers.cover import (
    HALF_LENGTH_WEIGHT,
    RADIUS_ROUNDING,
    UncertaintyCover,
)
from workbench.uncertainty.covers.joint.descent import least_size
from workbench.uncertainty.covers.joint.model_size import model_size
from workbench.uncertainty.covers.joint.size_data import CIRCLE, NOMINAL, REAL, SizeData
from workbench.uncertainty.covers.sets import deviations, outermost
from workbench.uncertainty.covers.sizes.inflation import extent, plant_sizes
from workbench.uncertainty.covers.weights import between, beyond

MAX_BFGS_STEPS = 200
"""Largest number of quasi-Newton steps with each power. A search ends earlier once it settles. With
half of them those along narrow ridges stop early; double costs time only there.
"""
LEAST_UNIT = 0.3
"""Least unit of a coefficient, or of its logarithm, in the search. A coefficient near 0 needs a
step too; roots then move by a third of their frequency. Half or double changes the path of a
search, and not the optimum that it ends at.
"""
SEARCHED_LOG_STEP = 0.1
"""Largest step of log omega between the frequencies at which the search evaluates W_c. It resolves
a weight of damping 0.1, and five times as fine a grid judges the end. With half of it a search
takes longer; with double of it the gain is raised more at the end.
"""
COVER_ROOT_REACH = 1e3
"""Largest factor from the first or last frequency to a root of the nominal or of a weight. A root
there changes the response by 0.1 % within the band. Half or double moves roots that matter as
little.
"""
BEYOND, BEYOND_DECADES = 0.01, 4
"""Weight of the mean square of a weight outside the given frequencies, with one frequency in each
decade. For the real weight this covers the given number of decades below and above, for W_c the
frequencies at which it is evaluated. It only settles what no data settle. With half of it weights
may grow outside; with double of it the fit inside gives up a little more.
"""


Aim = Literal["size", "inflation"]
"""What a search minimises: the mean square size of the sets, or the inflation over the raw sets."""


class FoundModel(NamedTuple):
    """Nominal, real weight (None for circles) and complex weight, and their mean square size.

    Unlike an `UncertaintyModel`, it is a candidate of a search, with its cost.
    """

    nominal: Rational
    W_r: Rational | None
    W_c: Rational
    size: float = np.inf

    def parts(self, *, fixed: bool) -> dict[str, Rational]:
        """Functions by name, without the nominal if it is fixed."""
        named = {"nominal": None if fixed else self.nominal, "W_r": self.W_r, "W_c": self.W_c}
        return {name: part for name, part in named.items() if part is not None}


@dataclass(frozen=True)
class ModelSize:
    """Mean square size of a model as a function of the parameters of its parts.

    ``nominal`` is None if the program gives it; ``W_r`` is None for circles.
    """

    program: UncertaintyCover
    nominal: FactoredRational | None
    W_r: FactoredRational | None
    W_c: FactoredRational

    @classmethod
    def of(cls, program: UncertaintyCover, model: FoundModel) -> ModelSize:
        """The size function for a search that starts from a model."""
        omega = program.responses.axis
        band = float(omega[0]), float(omega[-1])

        def factored(
            part: Rational, zeros: int, minimum_phase: bool, right: int = 0
        ) -> FactoredRational:
            return FactoredRational.of(part, zeros, band, True, minimum_phase, right)

        nominal, W_r, W_c, _ = model
        return cls(
            program,
            factored(nominal, program.zeros, False, program.unstable_poles)
            if program.nominal is None
            else None,
            None if W_r is None else factored(W_r, W_r.order, program.minimum_phase),
            factored(W_c, W_c.order, True),
        )

    def __call__(self, vector: RealArray, power: int) -> tuple[float, RealArray]:
        """Size with a norm of a given power, a power of two, and its gradient."""
        value, gradient = model_size(vector, self.data, power)
        return value, gradient

    @property
    def parts(self) -> tuple[FactoredRational | None, ...]:
        """Nominal, real weight and complex weight; None for a part without parameters."""
        return self.nominal, self.W_r, self.W_c

    @cached_property
    def start(self) -> RealArray:
        """Vector of parameters at the start."""
        return np.concatenate([part.start for part in self.parts if part])

    @property
    def unit(self) -> RealArray:
        """Units (P,) in which the parameters of the start are of size 1 or less."""
        size = np.abs(self.start)
        found = np.maximum(size, LEAST_UNIT)
        gains = self.ends[1:][np.diff(self.ends) > 0] - 1
        found[gains] = np.where(size[gains] > 0.0, size[gains], 1.0)
        return found

    @cached_property
    def ends(self) -> np.ndarray:
        """Indices (4,) of the vector at which the parts begin, and its size."""
        return np.cumsum([0, *(part.start.size if part else 0 for part in self.parts)])

    @cached_property
    def data(self) -> SizeData:
        """The data for the compiled size function."""
        program, responses = self.program, self.program.responses
        omega, unit, given = responses.axis, program.unit, program.nominal
        tables = [part.table if part else NO_FACTORS for part in self.parts]
        decades = 10.0 ** np.arange(1, BEYOND_DECADES + 1)
        far = np.concatenate([omega[0] / decades, omega[-1] * decades])
        additive = program.form == "additive"
        size = np.abs(program.points).max(axis=1) / unit if additive else np.ones_like(unit)
        pairs = [self._pairs(k) for k in (REAL, CIRCLE)]
        raw, plain = program.raw_sets, plant_sizes(program.points)
        free = np.maximum(extent(raw) / plain, RADIUS_ROUNDING)
        reached = np.union1d(beyond(omega), between(omega, SEARCHED_LOG_STEP))
        log = np.log(omega)
        place = np.interp(np.log(reached), log, np.arange(omega.size))
        row = place.astype(int)
        counted = np.where(np.isin(reached, omega), responses.shares[row], 0.0)
        outside = (reached < omega[0]) | (reached > omega[-1])
        counted[outside] = BEYOND / np.count_nonzero(outside)
        return SizeData(
            omega=omega,
            points=np.ascontiguousarray(outermost(program.points)),
            unit=unit,
            floor=RADIUS_ROUNDING * size,
            nominal=np.zeros(0, complex) if given is None else given.response(omega),
            shares=responses.shares,
            reached=reached,
            row=row,
            onward=place - row,
            counted=counted,
            far=far,
            far_unit=np.repeat([unit[0], unit[-1]], BEYOND_DECADES) * np.sqrt(far.size / BEYOND),
            level=np.concatenate([table[0] for table in tables]),
            coefficients=np.concatenate([table[1] for table in tables]),
            moving=np.concatenate([table[2] for table in tables]),
            positive=np.concatenate([table[3] for table in tables]),
            factor=np.cumsum([0, *(len(table[0]) for table in tables)]),
            numerators=np.array([table[4] for table in tables]),
            parameter=self.ends,
            damping=np.concatenate([damping for damping, _ in pairs]),
            tone=np.concatenate([tone for _, tone in pairs]),
            middle=(log[1:] + log[:-1]) / 2,
            gap=np.diff(log),
            multiplicative=not additive,
            length_weight=HALF_LENGTH_WEIGHT,
            about=np.zeros(0),
            free=free,
            plain=plain,
            free_square=float(responses.shares @ (raw.radius / plain) ** 2),
            given=np.isin(reached, omega),
        )

    def inflation_data(self, vector: RealArray) -> SizeData:
        """The data for the inflation over the raw sets about the nominal of given parameters."""
        program, omega = self.program, self.program.responses.axis
        if self.nominal is None:
            nominal = program.nominal.response(omega)
        else:
            nominal = self.nominal.response(vector[: self.ends[1]], omega)
        responses = program.responses
        away = deviations(program.points, nominal, program.form, responses)
        raw = program.second_set(away)
        size = extent(raw) / program.unit
        return self.data._replace(about=np.maximum(size, RADIUS_ROUNDING))

    def _pairs(self, k: int) -> tuple[RealArray, RealArray]:
        """Logarithms of damping and frequency of the root pairs of a weight, as functions of the
        whole vector.
        """
        part, count = self.parts[k], self.start.size
        if part is None:
            return np.zeros((0, count + 1)), np.zeros((0, count + 1))
        places = np.append(np.arange(self.ends[k], self.ends[k + 1]), count)
        found = []
        for rows in pair_logarithms(part):
            wide = np.zeros((len(rows), count + 1))
            wide[:, places] = rows
            found.append(wide)
        return found[0], found[1]


NO_FACTORS = (
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros((0, 3), dtype=bool),
    np.zeros(0, dtype=bool),
    0,
)
"""The table of factors of a part without parameters."""


def smallest_model(
    program: UncertaintyCover,
    start: FoundModel,
    powers: tuple[int, ...],
    context: Context,
    spread: float = 0.0,
    aim: Aim = "size",
    steps: int = MAX_BFGS_STEPS,
) -> FoundModel:
    """The model with the smallest sets found from a start, which is a local optimum.

    The search begins at a random point around the start, with a standard deviation of ``spread``
    units of each parameter. It makes at most ``steps`` quasi-Newton steps with each power on the
    coefficients of quadratic factors.
    Norms with the given increasing powers, which are powers of two, approximate the largest ratio
    of a needed radius to the complex weight.
    """
    size = ModelSize.of(program, start)
    vector, omega = size.start, program.responses.axis
    unit = size.unit
    inverse = np.zeros((vector.size, vector.size))
    value, x = np.inf, vector / unit
    if spread:
        x = x + spread * context.rng.standard_normal(x.size)
    for power in context.track(powers, "smallest sets"):
        data = size.data if aim == "size" else size.inflation_data(x * unit)
        value, x, inverse = least_size(x, unit, inverse, data, power, steps)
    own = np.split(x * unit, size.ends[1:-1])

    def found(part: FactoredRational, vector: RealArray) -> Rational:
        return within_reach(part.rational(vector), omega, COVER_ROOT_REACH)

    return FoundModel(
        start.nominal if size.nominal is None else found(size.nominal, own[NOMINAL]),
        None if size.W_r is None else found(size.W_r, own[REAL]),
        found(size.W_c, own[CIRCLE]),
        value,
    )
