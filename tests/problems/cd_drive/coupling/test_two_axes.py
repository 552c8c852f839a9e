"""Both loops of a drive together."""

import numpy as np
import pytest
from workbench.plants.cd_drive.coupling.bench import (
    STEP,
    TwoAxisBench,
    track_light,
)
from workbench.plants.cd_drive.coupling.paths import UNCOUPLED, Coupling, TwoAxes
from workbench.plants.cd_drive.coupling.two_axes import limits, performance
from workbench.plants.cd_drive.coupling.two_axes.identification import exact, identified, shares
from workbench.plants.cd_drive.coupling.two_axes.problem import QUIET, TwoAxesStudy
from workbench.plants.cd_drive.coupling.two_axes.runs import (
    disc_of,
    kicked,
    largest_errors,
    linear_errors,
)
from workbench.plants.cd_drive.drive.actuator import specific_model
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.drive.tables import AXES
from workbench.plants.cd_drive.laboratory.bench_setup import coil_gain, find_drive
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench import solve
from workbench.errors import InputError
from workbench.simulation import linear_controller
from workbench.solvers import Options
from workbench.systems import response

OMEGA = 2 * np.pi * np.geomspace(5.0, 5e3, 40)
EVERY = limits.GUESSED


def test_without_coupling_each_axis_is_the_specific_model():
    found = TwoAxes("CD9").response(OMEGA)
    for n, axis in enumerate(AXES):
        drive = find_drive(axis, "CD9")
        alone = coil_gain(drive) * specific_model(drive).response(OMEGA / (2 * np.pi))
        assert found[:, n, n] == pytest.approx(alone, rel=1e-9)
    assert not found[:, [0, 1], [1, 0]].any()


def test_masses_dampers_and_springs_store_and_lose_energy():
    for matrix in TwoAxes("CD1", EVERY).matrices:
        assert matrix == pytest.approx(matrix.T)
        assert np.linalg.eigvalsh(matrix).min() >= -1e-12


def test_a_coupled_lens_is_passive():
    """The power that both coils take is never negative, whatever turns or rolls."""
    two = TwoAxes("CD5", Coupling(magnetic=0.3, springs=0.8))
    volts = np.diag([coil_gain(one) for one in two.axes])
    Bl = np.diag([one.Bl for one in two.axes])
    R = np.diag([one.R + 1.25 for one in two.axes])
    _, C, _ = two.matrices
    M, _, K = two.matrices
    force, damping = two.electromechanics
    along = force @ np.linalg.inv(volts) @ R @ np.linalg.inv(Bl)
    s = 1j * OMEGA[:, None, None]
    q = np.linalg.solve(s**2 * M + s * (C + damping) + K, np.broadcast_to(force + 0j, (40, 6, 2)))
    current = np.linalg.inv(R) @ (volts - Bl @ along.T @ (s * q))
    admittance = current @ np.linalg.inv(volts)
    taken = admittance + np.conj(np.swapaxes(admittance, 1, 2))
    assert np.linalg.eigvalsh(taken).min() > 0.0


@pytest.mark.parametrize("coupling", [UNCOUPLED, EVERY], ids=["none", "every"])
def test_two_ways_to_the_performance(coupling):
    two = TwoAxes("CD3", coupling)
    direct = performance.performance_response(two, OMEGA)
    for place in performance.PLACES:
        system = performance.performance_system(two, place)
        assert np.linalg.eigvals(system.A).real.max() < 0.0
        by_states = response(system, OMEGA)[:, 2:, 2:]
        assert by_states == pytest.approx(direct, rel=1e-9, abs=1e-9)


def test_a_known_coupling_closes_the_system_of_any_coupling():
    """The electrical path is the coupling that passes its share in both directions."""
    at = 2 * np.pi * 400.0
    share = 0.02
    one = limits.gain_with(TwoAxes("CD4"), "force", np.array([share, share]), at)
    other = limits.largest_gain(TwoAxes("CD4", Coupling(electrical=share)), np.array([at]))
    assert one == pytest.approx(other, rel=1e-9)
    one = limits.gain_with(TwoAxes("CD4"), "reading", np.array([share, share]), at)
    other = limits.largest_gain(TwoAxes("CD4", Coupling(optical=share)), np.array([at]))
    assert one == pytest.approx(other, rel=1e-9)


def test_the_deviation_ratio_is_that_of_the_red_book():
    ratio = abs(performance.deviation_ratio()(1j * np.array([1.0, 1e5])))
    assert ratio == pytest.approx([500 / 70, 10 / 0.4], rel=1e-3)


def test_a_path_beyond_its_limit_loses_the_performance():
    size = limits.path_limit("CD4", "electrical", 1.0, OMEGA)
    for factor, kept in ((0.99, True), (1.01, False)):
        gain = limits.largest_gain(limits.of_path("CD4", "electrical", factor * size), OMEGA)
        assert (gain < 1.0) is kept
    assert limits.path_limit("CD1", "springs", 1.0, OMEGA[:2]) == np.inf


def test_any_coupling_below_its_limit_is_harmless():
    found = limits.any_coupling(TwoAxes("CD4"), "force")
    assert found.mu.upper < 1.0
    gain = limits.gain_with(TwoAxes("CD4"), "force", found.worst, found.omega)
    assert gain == pytest.approx(1.0, abs=1e-4)
    rng = np.random.default_rng(0)
    turns = found.kept * np.exp(2j * np.pi * rng.uniform(size=(20, 2)))
    gains = [limits.gain_with(TwoAxes("CD4"), "force", one, found.omega) for one in turns]
    assert max(gains) < 1.0


def test_tracks_fade_out_of_focus():
    contrast = track_light().contrast
    assert contrast[0] == 1.0 and 0.68 < contrast[round(2e-6 / STEP)] < 0.73
    assert contrast[round(6e-6 / STEP)] < 0.0


@pytest.mark.parametrize(("n", "axis"), [(0, "focus"), (1, "radial")])
def test_uncoupled_loops_run_as_in_the_laboratory_of_one_axis(n, axis):
    """Only the light of the tracks is new, and it cancels in the normalised error."""
    disc = disc_of(0.05)
    both = TwoAxisBench("CD2", **QUIET).closed_loop(disc, 0.3)
    bench = Laboratory(axis, "CD2", noise=0.0, electronics=0.0, bits=None)
    law = linear_controller(controller(axis), 1 / 35e3)
    alone = bench.closed_loop(law, duration=0.3, disc=disc)
    assert both.error[:, n] == pytest.approx(
        alone.x_cd - alone.x, abs=5e-3 * np.ptp(both.error[:, n])
    )


def test_errors_are_those_of_the_linear_loops():
    found = largest_errors(TwoAxisBench("CD7", EVERY, **QUIET), 0, 0.2)
    assert found == pytest.approx(linear_errors(TwoAxes("CD7", EVERY), 0.2), rel=0.05)


def test_kicks():
    """Out of focus the track is lost too; a lens that jumps tracks stays in focus."""
    bench = TwoAxisBench("CD1")
    dragged, jumped = kicked(bench, 0, 30, 1), kicked(bench, 1, 10, 1)
    assert (dragged.focus_lost, dragged.radial_lost) == (1.0, 1.0)
    assert (jumped.focus_lost, jumped.radial_lost) == (0.0, 1.0)
    assert jumped.focus < 1e-6 < jumped.radial


def test_an_identified_coupling_is_the_true_one():
    bench = TwoAxisBench("CD6", Coupling(electrical=0.03))
    found, true = identified(bench, 5), exact(bench.two)
    inside = abs(found.response - true) <= found.radius
    assert inside[:, [0, 1], [1, 0]].mean() > 0.9
    assert abs(shares(true)) == pytest.approx(0.03, rel=1e-6)
    assert np.median(abs(shares(found.response)[:, 1])) == pytest.approx(0.03, rel=0.2)
    assert (found.largest < [2e-6, 0.2e-6]).all()


def test_bad_sizes_are_named():
    with pytest.raises(InputError, match=r"tilt is nan; it must be finite"):
        Coupling(tilt=np.nan)
    with pytest.raises(InputError, match=r"springs is -1\.0; it must lie between -1 and 3"):
        Coupling(springs=-1.0)
    with pytest.raises(InputError, match=r"path is 'air'; known: electrical, magnetic"):
        Coupling.alone("air", 0.1)


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = TwoAxesStudy(1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["kept_force_least"] > 0.01 < numbers["kept_reading_least"]
        # The numbers and limits of the ledger.
        assert numbers["track_lost_with_focus_mean"] >= 0.95
        assert numbers["focus_lost_by_jumps"] <= 0.01
        assert numbers["focus_error_by_jumps"] <= 1.5
        assert numbers["radial_error_by_focus_in_range"] <= 1.1
        assert numbers["seen_to_radial_alike"] > 0.9 > numbers["seen_to_radial_none"]
    wrong = solution.answer.copy(deep=True)
    wrong["kept"][...] *= 1.5
    wrong["worst"][...] *= 0.9
    wrong["limit"][...] *= 0.5
    wrong["quiet"][...] *= 1.2
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert failed >= {"lost", "paths", "linear", "half the step"}
