"""The strategies: stability, the order that the thesis found, speed, and what they refuse."""

from dataclasses import replace
from functools import partial

import control
import numpy as np
import pytest
from lanes import thinned
from timing import least_seconds
from workbench.plants.cd_drive.diagnosis.scratch_draws import ScratchDraw
from workbench.plants.cd_drive.drive.disc import Defect, Disc
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD, RATE
from workbench.plants.cd_drive.laboratory.experiment import MEASUREMENTS, Laboratory, _loop
from workbench.plants.cd_drive.tolerance.strategies.problem import strategies
from workbench.plants.cd_drive.tolerance.strategies.runs import (
    LENGTH,
    Experiment,
    envelope,
)
from workbench.plants.cd_drive.tolerance.strategies.stability import (
    estimated_decay,
    repetitive_level,
)
from workbench.plants.cd_drive.tolerance.tactics import (
    STRATEGIES,
    Strategies,
    clean_level,
    stand_in_filter,
)

from workbench import solve
from workbench._core.compiled import compiled
from workbench.errors import InputError, UnknownNameError
from workbench.simulation import Cascade, Controller, Part
from workbench.solvers import Options
from workbench.systems.storage import restored_system

AXES = ("focus", "radial")
TWELVE = ("nominal", *(f"CD{n}" for n in range(1, 13)))
DISC = Disc(warp=(500e-6,), eccentricity=(70e-6,), rotation=5.5)


@pytest.fixture(scope="module")
def studies(slower):
    """Study and solution by axis, on the nominal drive and one more, each computed once."""
    found = {}

    def run(axis, seed=4, drive_count=1):
        if (axis, seed) not in found:
            task = strategies(axis, slower[axis], drive_count=drive_count, draws=6)
            found[axis, seed] = task, solve(task, options=Options(seed=seed))
        return found[axis, seed]

    return run


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_the_order_is_that_of_the_thesis(studies, axis):
    task, solution = studies(axis)
    assert solution.certificate.valid, solution.certificate.failures
    numbers = task.metrics(solution.answer)
    for name in "ABC":
        assert numbers[f"excursion_{name}_mean"] < 0.6 * numbers["excursion_reference_mean"]
    for name in "AB":
        assert numbers[f"periodic_{name}_high"] < 0.05 * numbers["periodic_reference_low"]
        assert numbers[f"excursion_{name}_mean"] < 0.7 * numbers["excursion_C_mean"]
    assert numbers["periodic_C_mean"] == pytest.approx(numbers["periodic_reference_mean"], rel=0.05)
    assert set(task.tables(solution.answer)) == {"excursion", "periodic", "claims"}


@pytest.mark.slow
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_another_seed_changes_no_verdict(studies, axis):
    task, solution = studies(axis)
    other = studies(axis, seed=5, drive_count=0)[1]
    first, second = (one.answer["excursion"].sel(drive="nominal") for one in (solution, other))
    assert (first != second).all()
    verdicts = [
        {check.name: check.holds for check in task.checks(one.answer, 1e-6)}
        for one in (solution, other)
    ]
    assert verdicts[0] == verdicts[1]


@pytest.mark.cases(0)
def test_draws_are_independent_and_strategies_share_them(studies):
    task, solution = studies("focus")
    answer = solution.answer
    for name in ("seed", "angle", "edge"):
        assert len(np.unique(answer[name])) == answer[name].size == 12
    assert set(np.unique(answer["sign"])) == {-1.0, 1.0}
    one = answer.sel(drive="CD1", draw=5)
    again = task.outcomes("CD1", ScratchDraw.drawn("focus", int(one["seed"])))
    np.testing.assert_array_equal(one["excursion"], [outcome.excursion for outcome in again])


@pytest.mark.cases(0)
def test_without_noise_the_scratch_costs_what_the_thesis_draws(studies):
    """Two other simulations of the printed scratch gave 0.100 and 0.054 um for A and B."""
    quiet = studies("focus")[1].answer["quiet_excursion"]
    assert float(quiet.sel(strategy="A")) == pytest.approx(0.1e-6, rel=0.05)
    assert float(quiet.sel(strategy="B")) == pytest.approx(0.054e-6, rel=0.05)
    experiment = Experiment("focus")
    costs = [
        experiment.outcome(
            experiment.scenario("nominal", "C", scratch, noisy=False).run(F=stand_in_filter()),
            scratch.angle,
        ).excursion
        for scratch in (ScratchDraw(0, 0.0), ScratchDraw(0, 0.0, sign=-1.0), ScratchDraw(0, 0.25))
    ]
    np.testing.assert_allclose(costs, [0.67e-6, 0.96e-6, 0.31e-6], rtol=0.02)


@pytest.mark.cases(0)
def test_checks_can_fail(studies):
    task, solution = studies("focus")
    worse = solution.answer.copy(deep=True)
    worse["reduced"].loc[{"strategy": "A", "level": 0.5}] = 0.94
    worse["readable"].loc[{"strategy": "B"}] = 0.94
    worse["periodic"].loc[{"strategy": "B", "drive": "CD1"}] = 1e-5
    worse["events"].loc[{"strategy": "C", "drive": "CD1", "draw": 3}] = 1
    worse["repetitive_level"][0] = 1.0
    worse["estimated_decay"][1] = -1.0
    worse["excursion_half_step"][0] *= 1.2
    failed = {check.name for check in task.checks(worse, 1e-6) if not check.holds}
    names = {"excursion A", "readable B", "periodic B", "kept", "repetitive loop", "estimated loop"}
    assert failed == {*names, "half the step"}


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_figures(studies, axis):
    task, solution = studies(axis)
    made = task.figures(solution.answer)
    assert set(made) == {"figure-8-6", "figure-8-7", "figure-8-8", "figure-8-9", "drives"}
    assert all(ax.get_ylabel() for figure in made.values() for ax in figure.axes)


def test_outcome_of_a_known_error():
    """5 um after a scratch, 2 um at the rotation, and 1 um at twice it."""
    experiment = Experiment("focus")
    record = experiment.scenario("nominal", "reference", experiment.printed(0)).run()
    wave = 2 * np.pi * 5.5 * record.time
    record.x[:] = record.x_cd - 2e-6 * np.sin(wave + 0.3) - 1e-6 * np.cos(2 * wave)
    plain = experiment.outcome(record, 0.0)
    assert plain.periodic == pytest.approx(2e-6, rel=1e-3)
    late = experiment.starts(0.0)[-2] + LENGTH / 1.3 + 4.9e-3
    record.x[round(late * RATE)] = record.x_cd[round(late * RATE)] - 5e-6
    assert experiment.outcome(record, 0.0).excursion == pytest.approx(5e-6)
    record.x[round(late * RATE) + 5] = record.x_cd[round(late * RATE) + 5] - 9e-6
    assert experiment.outcome(record, 0.0).excursion == pytest.approx(5e-6)
    bounds, _ = envelope(record.x)
    assert bounds[0].min() == np.float32(record.x.min())
    assert bounds[1].max() == np.float32(record.x.max())


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_repetitive_loops_are_stable_on_all_drives(axis):
    """The level against the drives' exact responses and the controller's own formula."""
    believed = Strategies(axis, 1.0, 5.5)
    frequency = np.geomspace(1.0, 17.4e3, 3000)
    z = np.exp(2j * np.pi * frequency * PERIOD)
    K = controller(axis)(2 / PERIOD * (z - 1) / (z + 1))
    Q = believed.repetitive.lowpass(z)
    for name in TWELVE:
        bench = Laboratory(axis, name)
        L = -bench.response(frequency)["f_en"] * K
        grid = abs(Q / (1 + L)).max()
        level = repetitive_level(believed, bench)
        assert grid <= level < 1.0
        assert level == pytest.approx(grid, rel=1e-3)


@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_estimated_loops_are_stable_on_all_drives(axis):
    believed = Strategies(axis, 1.0, 5.5)
    decay = [estimated_decay(believed, Laboratory(axis, name)) for name in TWELVE]
    assert min(decay) > 10.0


def test_a_controller_that_loses_the_drive_is_found_out():
    """Ten times the gain has no stable loop, and neither analysis says it has."""
    strong = control.ss(10.0 * controller("focus"))
    believed, bench = Strategies("focus", 1.0, 5.5, K=strong), Laboratory("focus")
    with pytest.raises(InputError, match="without repetitive control is unstable"):
        repetitive_level(believed, bench)
    assert estimated_decay(believed, bench) < 0.0


def test_removing_nothing_is_the_controller_alone():
    """With F = 0 strategy C feeds the controller what was measured, defect or not."""
    bench = Laboratory("focus", "nominal")
    nothing = control.ss([], [], [], [[0.0]], PERIOD)
    made = Strategies("focus", clean_level(bench), 5.5, F=nothing)
    defects = [Defect(1.2e-3, 0.25, 0.7)]
    record = bench.closed_loop(made.named("C"), duration=0.3, disc=DISC, defects=defects)
    np.testing.assert_array_equal(record.signals["seen"], record.f_en)
    assert (record.signals["w_Q"] < 1.0).any()


@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_bumpless_transfer_helps(axis, slower):
    """Radially the track is lost without it; in focus it costs nothing."""
    experiment, sizes = Experiment(axis), {}
    designed = restored_system(slower[axis].data, "sampled")
    for bumpless in (False, True):
        scratches = [experiment.printed(seed) for seed in range(3)]
        scenarios = (experiment.scenario("nominal", "K_prime", one) for one in scratches)
        runs = [replace(one, bumpless=bumpless).run(replacement=designed) for one in scenarios]
        sizes[bumpless] = np.mean(
            [
                experiment.outcome(*each).excursion
                for each in ((run, scratches[0].angle) for run in runs)
            ]
        )
    assert sizes[True] < {"focus": 1.1, "radial": 0.1}[axis] * sizes[False]


def test_a_strategy_without_its_controller_is_named():
    with pytest.raises(InputError, match=r"needs a controller K', .* cd/radial/lower-bandwidth"):
        Experiment("radial").scenario("nominal", "K_prime", ScratchDraw(0, 0.2)).run()


def test_the_stand_in_filter_leaves_a_low_pass():
    F = stand_in_filter()
    z = np.exp(2j * np.pi * 450.0 * PERIOD)
    assert abs(1.0 - F(z)) == pytest.approx(0.5**0.5, rel=1e-2)
    assert abs(F(np.exp(2j * np.pi * 1e-3 * PERIOD))) < 1e-5


def test_speed(slower):
    """A second of the nonlinear loop takes a tenth of a second of a processor at most.

    An ensemble of some hundred seconds then takes as long as somebody waits. On an idle core it is
    a fiftieth.
    """
    bench = Laboratory("focus", "nominal")
    designed = restored_system(slower["focus"].data, "sampled")
    made = Strategies("focus", clean_level(bench), 5.5, replacement=designed)
    samples = round(RATE)
    at = np.arange(samples + 1) / RATE
    seen = DISC.surface([Defect(1.2e-3, 0.0, 0.7)], at)
    exogenous = np.column_stack([DISC.deviation("focus", at), *seen])
    excitation, noise = np.zeros((samples, 1)), np.zeros((samples, 4))
    for name in STRATEGIES:
        cascade, loop = made.named(name), _loop(bench)
        run = partial(loop.run, cascade, excitation, exogenous, noise)
        assert least_seconds(run) < 0.1, name


@compiled
def _broken(state, parameters, given, told):
    state[0] += 1.0
    told[0] = np.nan if state[0] > 700.0 else 0.0


def test_refusals():
    made = Strategies("focus", 1.0, 5.5)
    with pytest.raises(UnknownNameError, match="no strategy is called 'D'"):
        made.named("D")
    other = control.ss(0.5, 1.0, 1.0, 0.0, 1e-4)
    with pytest.raises(InputError, match=r"the controller has dt = 0\.0001 s"):
        Strategies("focus", 1.0, 5.5, F=other).named("C")
    broken = Controller(_broken, np.zeros(1), np.zeros(0))
    cascade = Cascade(MEASUREMENTS, [Part("my strategy", broken, ["f_en"], outputs=["u"])])
    with pytest.raises(InputError, match=r"my strategy's output 'u' .* sample 700 of .*, 0\.02 s"):
        Laboratory().closed_loop(cascade, duration=0.1)


def test_a_robust_filter_has_to_be_given(slower):
    with pytest.raises(InputError, match="no run of it is given"):
        strategies("radial", slower["radial"], fault_filter="robust")
