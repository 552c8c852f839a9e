"""Both loops of a drive together: how large a coupling do they stand (section 3.5)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.mu import Peak, PeakChecker, skew_bounds
from workbench.study import (
    LEAST_COVERAGE_P,
    Study,
    answers,
    array,
    arrays,
    check,
    coverage_p,
    dim,
    figure,
    independent_seeds,
    metric,
    part,
    table,
)
from workbench.types import ComplexArray, DataArray, Dataset, RealArray

from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, drives
from ..bench import STEP, STEPS, TwoAxisBench, track_light
from ..paths import Coupling, TwoAxes
from .figures import by_frequency, by_kick, by_size, identified_shares
from .identification import FREQUENCIES, Identified, exact, identified, shares
from .limits import (
    GUESSED,
    PATHS,
    TOGETHER,
    Limit,
    any_coupling,
    gain_with,
    of_path,
    path_limit,
    relative_coupling,
    sized,
)
from .performance import CLOSED, PERFORMANCE, PLACES, largest_gain, performance_system
from .report import errors_told, identification_told, kicks_told, limits_told, sizes
from .runs import Kicked, kicked, largest_errors, linear_errors

SIGNS = {"alike": 1.0, "opposed": -1.0}
"""Signs of the couplings."""
CASES = ("none", *SIGNS)
"""No coupling, and GUESSED with either sign."""
PULSES = (1, 3, 5, 10, 20, 30)
"""Lengths [samples] of a kick at the largest voltage."""
GRID = np.geomspace(5.0, 5000.0, 150)
"""Frequencies [Hz] at which the limits of single paths are computed."""
SHOWN = np.geomspace(5.0, 5000.0, 60)
"""Frequencies [Hz] that figures show."""
EXAMPLE = "CD4"
"""Drive that figures over frequency show: the one with the least light, and the least margin."""
SMALL = 0.2
"""Share of the Red Book's deviations with which the loops are linear."""
QUIET: dict[str, Any] = {"noise": False, "bits": None}
KICKED = tuple(zip(Kicked._fields, ("f4", "f4", "i1", "i1"), strict=True))
"""Fields of a kick, and the kinds of numbers in which they are stored."""
LAG = 2e-3
"""Relative slack for what a path changes besides its coupling, which is of second order."""


@problem("cd/two-axes", data=(*TABLES, "data/red_book.csv"))
def two_axes(draws: Annotated[int, Field(ge=1, le=1000)] = 2) -> TwoAxesStudy:
    """Focus and radial loop together: may their couplings be neglected (section 3.5)?

    The reference controllers of both axes run on one lens. Electrical, magnetic, mechanical and
    optical paths couple the axes. Both loops keep their performance if the largest singular value
    from the disc's deviations to the weighted errors stays below 1, as each loop alone does.

    Assumed: the sizes of the couplings, of which the thesis prints none (see `GUESSED`), the
    geometry of the four arms, and the Red Book's deviations as weights. Computed from optics: how
    the tracks fade out of focus. Certified for each drive: the gain up to which any coupling keeps
    the performance, and a coupling that loses it. Computed at 150 frequencies: the largest size of
    each path. Simulated: errors on the Red Book's disc and after kicks, and the identification as a
    system of two inputs and outputs, with 99 % discs.

    draws: number of draws of the noise, for every drive and case.
    """
    return TwoAxesStudy(draws)


@dataclass(frozen=True)
class TwoAxesStudy(Study):
    """Certified limits of couplings, and simulations with couplings of a guessed size."""

    draws: int

    headline: ClassVar[str] = "kept_force_least"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each run"

    place, path, sign = dim(PLACES), dim(PATHS), dim(SIGNS)
    case, case_kicked = dim(CASES), dim(CASES[:2])
    axis, kick = dim(AXES), dim(AXES, meaning="axis that is kicked")
    entry = dim("from radial to focus", "from focus to radial")
    pulse = dim(PULSES, meaning="length of the kick in samples")
    drive = dim(lambda: [one.name for one in drives("focus")])
    draw = dim(lambda self: range(self.draws))
    frequency = dim(SHOWN, unit="Hz")
    line = dim(FREQUENCIES, unit="Hz")
    distance = dim(STEP * np.arange(STEPS), unit="m", meaning="focus error")

    # --- limits -------------------------------------------------------------------------------

    @part
    def limits(self, drive: DataArray, context: Context) -> list[list[Limit]]:
        """Limits for any coupling, by place and drive."""

        def one(name: str) -> list[Limit]:
            return [any_coupling(TwoAxes(name), place) for place in PLACES]

        found = context.spread(one, [str(name) for name in drive.values], "limits")
        return [list(row) for row in zip(*found, strict=True)]

    @answers
    def mu(self, limits: list[list[Limit]], drive: DataArray) -> dict[tuple[str, str], Peak]:
        """Peaks of mu with couplings up to `kept`."""
        names = drive.values.tolist()
        return {
            (place, name): one.mu
            for place, row in zip(PLACES, limits, strict=True)
            for name, one in zip(names, row, strict=True)
        }

    @mu.checkers
    def of_the_loops(self, kept: DataArray) -> dict[tuple[str, str], PeakChecker]:
        return {
            (place, name): PeakChecker(
                sized(
                    performance_system(TwoAxes(name), place),
                    float(kept.sel(place=place, drive=name)),
                ),
                CLOSED,
            )
            for place in PLACES
            for name in kept["drive"].values.tolist()
        }

    found_limits = arrays(
        (place, drive),
        lambda limits: {
            "kept": [[one.kept for one in row] for row in limits],
            "at": [[one.omega for one in row] for row in limits],
        },
        kept=("1", "gain up to which any coupling keeps the performance"),
        at=("rad/s", "frequency at which a larger one loses it"),
    )
    mu_upper = array(
        dims=(place, drive),
        unit="1",
        meaning="certified upper bound of mu with couplings up to `kept`",
        value=lambda mu, drive: [
            [mu[place, name].upper for name in drive.values.tolist()] for place in PLACES
        ],
    )

    @array(dims=(place, drive, entry), unit="1", meaning="gains of a coupling that loses it")
    def worst(self, limits: list[list[Limit]]) -> ComplexArray:
        return np.array([[one.worst for one in row] for row in limits])

    @array(dims=(path, sign, drive), unit="1", meaning="size of a path that loses the performance")
    def limit(self, drive: DataArray, context: Context) -> RealArray:
        omega = 2 * np.pi * GRID

        def one(name: str) -> list[list[float]]:
            return [
                [path_limit(name, path, sign, omega) for sign in SIGNS.values()] for path in PATHS
            ]

        found = context.spread(one, [str(name) for name in drive.values], "paths")
        return np.moveaxis(np.array(found), 0, -1)

    @array(dims=(case, drive), unit="1", meaning="largest gain from deviations to errors")
    def gain(self, drive: DataArray) -> list[list[float]]:
        omega = 2 * np.pi * GRID
        return [
            [largest_gain(of_path(str(one), TOGETHER, size), omega) for one in drive.values]
            for size in (0.0, *SIGNS.values())
        ]

    @array(dims=(place, frequency), unit="1", meaning="largest coupling at each frequency, CD4")
    def allowed(self) -> list[RealArray]:
        s = 2j * np.pi * SHOWN
        systems = [performance_system(TwoAxes(EXAMPLE), place)(s) for place in PLACES]
        return [
            1 / skew_bounds(np.moveaxis(N, -1, 0), CLOSED, [PERFORMANCE]).upper for N in systems
        ]

    @array(dims=(path, frequency), unit="1", meaning="from focus to radial at guessed sizes, CD4")
    def coupled(self) -> list[RealArray]:
        omega = 2 * np.pi * SHOWN
        whole = {name: Coupling.alone(name, size) for name, size in vars(GUESSED).items()}
        every = [*whole.values(), GUESSED]
        return [relative_coupling(TwoAxes(EXAMPLE, one), omega)[:, 1].astype("f4") for one in every]

    contrast = array(
        dims=distance,
        unit="1",
        meaning="variation of the light across the tracks over that in focus",
        value=lambda: track_light().contrast,
    )

    # --- simulations --------------------------------------------------------------------------

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> list[Any]:
        """Errors, kicks and identifications, by drive and draw."""

        def one(place: tuple[int, ...]) -> tuple[list[RealArray], list[Any], list[Identified]]:
            name, number = str(seed[place]["drive"].values), int(seed[place])
            benches = [TwoAxisBench(name, one) for one in _couplings()]
            kicks = [
                [[kicked(bench, axis, pulse, number) for pulse in PULSES] for axis in (0, 1)]
                for bench in benches[:2]
            ]
            known = [identified(bench, number) for bench in benches[:2]]
            return [largest_errors(bench, number) for bench in benches], kicks, known

        return context.spread(one, list(np.ndindex(seed.shape)), "runs")

    @array(dims=(case, axis, drive, draw), unit="m", meaning="largest error in a turn of the disc")
    def largest(self, met: list[Any], seed: DataArray) -> Any:
        return _by_draw([one[0] for one in met], seed).astype("f4")

    told = arrays(
        (case_kicked, kick, pulse, drive, draw),
        lambda kicks: {name: kicks[..., n].astype(kind) for n, (name, kind) in enumerate(KICKED)},
        focus=("m", "largest focus error after a kick"),
        radial=("m", "largest radial error after a kick"),
        focus_lost=("1", "whether the focus is lost"),
        radial_lost=("1", "whether the track is lost"),
    )

    @part
    def kicks(self, met: list[Any], seed: DataArray) -> RealArray:
        """Kicks (cases, axes, pulses, drives, draws, 4)."""
        found = np.reshape([one[1] for one in met], (*seed.shape, 2, 2, len(PULSES), 4))
        return np.moveaxis(found, (0, 1), (3, 4))

    @part
    def crossed(self, met: list[Any], seed: DataArray) -> tuple[ComplexArray, RealArray]:
        """Cross responses and their radii (cases, drives, draws, lines, entries)."""
        cross = [0, 1], [1, 0]
        values, radius = (
            [[getattr(known, name)[:, *cross] for known in one[2]] for one in met]
            for name in ("response", "radius")
        )
        shape = (*seed.shape, 2, len(FREQUENCIES), 2)
        return tuple(np.moveaxis(np.reshape(one, shape), 2, 0) for one in (values, radius))  # type: ignore[return-value]

    identified_lines = arrays(
        (case_kicked, drive, draw, line, entry),
        lambda crossed, drive: {
            "covered": (abs(crossed[0] - _exact_cross(drive)[:, :, None]) <= crossed[1]).astype(
                "i1"
            ),
            "seen": (abs(crossed[0]) > crossed[1]).astype("i1"),
        },
        covered=("1", "whether the 99 % disc contains the cross response"),
        seen=("1", "whether it excludes 0"),
    )
    resolved = array(
        dims=(drive, draw, entry),
        unit="1",
        meaning="radius of a cross response over the own one, median of the lines without coupling",
        value=lambda crossed, drive: np.median(crossed[1][0] / _own(drive)[:, None], axis=2),
    )
    in_use = array(
        dims=(case_kicked, axis, drive, draw),
        unit="m",
        meaning="largest error while it is identified",
        value=lambda met, seed: _by_draw([[k.largest for k in one[2]] for one in met], seed),
    )
    shown = arrays(
        (case_kicked, line, entry),
        lambda met: {
            "share": [abs(shares(one.response)) for one in met[0][2]],
            "share_radius": [_share_radius(one) for one in met[0][2]],
        },
        share=("1", "cross response over the own one, CD1"),
        share_radius=("1", "radius of its 99 % disc"),
    )

    @array(dims=(axis, drive), unit="m", meaning="largest error on a flatter disc, without noise")
    def quiet(self, drive: DataArray) -> RealArray:
        benches = [TwoAxisBench(str(one), GUESSED, **QUIET) for one in drive.values]
        return np.transpose([largest_errors(one, 0, SMALL) for one in benches])

    @array(
        dims=axis, unit="m", meaning="the same of the first drive, optics followed twice as finely"
    )
    def half_step(self, drive: DataArray) -> RealArray:
        bench = TwoAxisBench(str(drive.values[0]), GUESSED, **QUIET)
        return largest_errors(replace(bench, refine=2), 0, SMALL)

    # --- checks -------------------------------------------------------------------------------

    @check(title="kept", at_most=1.0)
    def keeps(self, mu_upper: DataArray) -> DataArray:
        """certified mu with the couplings that are said to be harmless"""
        return mu_upper

    @check(title="lost", at_most=1e-4)
    def loses(self, worst: DataArray, at: DataArray) -> DataArray:
        """by how much the gain with the couplings that are said to lose the performance is below
        1
        """
        found = at.copy(deep=True)
        for place in PLACES:
            for name in at["drive"].values.tolist():
                here = {"place": place, "drive": name}
                gain = gain_with(TwoAxes(name), place, worst.sel(here).values, float(at.sel(here)))
                found.loc[here] = 1.0 - gain
        return found

    @check(title="paths", at_most=LAG)
    def no_path_below(self, kept: DataArray, limit: DataArray) -> float:
        """by which share the coupling of a path that loses the performance is below the certified
        one
        """
        omega, worst = 2 * np.pi * GRID, -np.inf
        for name in kept["drive"].values.tolist():
            for path in ("electrical", "magnetic", "springs", "tilt"):
                for sign, factor in SIGNS.items():
                    size = float(limit.sel(path=path, sign=sign, drive=name))
                    if np.isfinite(size):
                        reached = relative_coupling(of_path(name, path, factor * size), omega).max()
                        worst = max(worst, float(kept.sel(place="force", drive=name)) / reached - 1)
            size = float(limit.sel(path="optical", drive=name).min())
            worst = max(worst, float(kept.sel(place="reading", drive=name)) / size - 1)
        return worst

    @check(title="coverage", at_most=1.0 - LEAST_COVERAGE_P)
    def covers(self, covered: DataArray) -> float:
        """one minus the probability that 99 % discs of cross responses cover so few lines"""
        import xarray as xr

        every = xr.DataArray(covered.values.ravel() == 1, dims="draw")
        return float(1.0 - coverage_p(every, 0.99))

    @check(title="linear", at_most=0.05)
    def linear(self, quiet: DataArray) -> float:
        """relative difference of simulated errors without noise from those of the linear loops"""
        twos = [TwoAxes(str(one), GUESSED) for one in quiet["drive"].values]
        predicted = np.transpose([linear_errors(one, SMALL) for one in twos])
        return float(abs(quiet.values / predicted - 1.0).max())

    @check(title="half the step", at_most=1e-3)
    def replayed(self, half_step: DataArray, quiet: DataArray) -> DataArray:
        """relative change of the errors when the optics are followed twice as finely"""
        return abs(half_step / quiet.isel(drive=0) - 1.0)

    # --- what is told -------------------------------------------------------------------------

    told_limits, told_errors = metric(limits_told), metric(errors_told)
    told_kicks, told_lines = metric(kicks_told), metric(identification_told)
    told_sizes = table(sizes)

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {
            "coupling": by_frequency(answer, EXAMPLE),
            "limits": by_size(answer, vars(GUESSED)),
            "kicks": by_kick(answer),
            "identified": identified_shares(answer),
        }


def _couplings() -> list[Coupling]:
    """Couplings of CASES."""
    opposed = Coupling(**{name: -size for name, size in vars(GUESSED).items()})
    return [Coupling(), GUESSED, opposed]


def _by_draw(rows: list[Any], seed: DataArray) -> RealArray:
    """Values (cases, axes, drives, draws) of rows by drive and draw."""
    found = np.array(rows, float)
    return np.moveaxis(found.reshape(*seed.shape, *found.shape[1:]), (0, 1), (-2, -1))


def _exact_cross(drive: DataArray) -> ComplexArray:
    """True cross responses (cases, drives, lines, entries)."""
    return np.array(
        [
            [exact(TwoAxes(str(one), coupling))[:, [0, 1], [1, 0]] for one in drive.values]
            for coupling in _couplings()[:2]
        ]
    )


def _own(drive: DataArray) -> RealArray:
    """Sizes of the own responses (drives, lines, entries)."""
    return np.array([abs(exact(TwoAxes(str(one)))[:, [0, 1], [0, 1]]) for one in drive.values])


def _share_radius(one: Identified) -> RealArray:
    """Radius (lines, entries) of the disc of a cross response over the own response."""
    radius: RealArray = one.radius[:, [0, 1], [1, 0]] / abs(one.response[:, [0, 1], [0, 1]])
    return radius
