"""Plants that miss assumptions of H-infinity synthesis: perturbed until the norm settles."""

import warnings

import control
import cvxpy as cp
import numpy as np
import pytest
from scipy.linalg import block_diag, null_space

from workbench import Options, Outcome, solve
from workbench.certify.norms import certified_norm
from workbench.errors import InputError
from workbench.synthesis import (
    HinfSynthesis,
    MixedSensitivity,
    MuSynthesis,
    hinf,
    regularise,
)
from workbench.synthesis.h_infinity.assumptions import checked, need_stabilisable
from workbench.synthesis.h_infinity.normalised import SingularPlantError, has_rank
from workbench.synthesis.h_infinity.singular_plants.fast_poles import without_fast_poles
from workbench.synthesis.h_infinity.singular_plants.perturbed import made_regular, wholly_perturbed
from workbench.systems.realisation import realisation
from workbench.systems.standard_plant import standard_plant
from workbench.uncertainty import GeneralisedPlant, generalised_plant, real, tf

S = control.tf("s")
TOO_HIGH = 1e-2
"""Relative error of an infimum that the inequalities only approach; a certified norm has none."""


def plant_of(A, B1, B2, C1, C2, D11=None, D12=None, D21=None, D22=None, dt=0.0):
    """A plant of its blocks; blocks of D not given are 0."""
    A, B1, B2, C1, C2 = (np.atleast_2d(np.array(part, float)) for part in (A, B1, B2, C1, C2))
    blocks = [[D11, D12], [D21, D22]]
    for i, rows in enumerate((len(C1), len(C2))):
        for j, columns in enumerate((B1.shape[1], B2.shape[1])):
            if blocks[i][j] is None:
                blocks[i][j] = np.zeros((rows, columns))
            blocks[i][j] = np.atleast_2d(blocks[i][j])
    matrices = A, np.hstack([B1, B2]), np.vstack([C1, C2]), np.block(blocks)
    return GeneralisedPlant(realisation(matrices, dt), None, B2.shape[1], len(C2))


def least_by_inequalities(plant):
    """The infimum of the norm (Gahinet and Apkarian 1994); D12 and D21 need no rank.

    Where no controller reaches it, X or Y grows without end: the solver warns, and what it gives is
    up to `TOO_HIGH` above the infimum.
    """
    given = standard_plant(plant)
    n, gamma = given.states, cp.Variable()
    X, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, n), symmetric=True)

    def bounded(P, Z):
        N = block_diag(null_space(np.vstack([P.B2, P.D12]).T), np.eye(P.D11.shape[1]))
        z, w = P.D11.shape
        matrix = cp.bmat(
            [
                [P.A @ Z + Z @ P.A.T, Z @ P.C1.T, P.B1],
                [P.C1 @ Z, -gamma * np.eye(z), P.D11],
                [P.B1.T, P.D11.T, -gamma * np.eye(w)],
            ]
        )
        inside = N.T @ matrix @ N
        return (inside + inside.T) / 2 << 0

    coupling = cp.bmat([[X, np.eye(n)], [np.eye(n), Y]]) >> 0
    problem = cp.Problem(cp.Minimize(gamma), [bounded(given, X), bounded(given.dual, Y), coupling])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Solution may be inaccurate")
        problem.solve(solver="CLARABEL")
    return float(gamma.value)


def random_parts(seed, n=4, w=2, u=2, z=3, y=2):
    """A, B1, B2, C1 and C2 at random, with some modes that are not stable."""
    rng = np.random.default_rng(seed)
    shapes = (n, n), (n, w), (n, u), (z, n), (y, n)
    return [rng.normal(size=shape) for shape in shapes]


def state_feedback(seed):
    A, B1, B2, C1, _ = random_parts(seed)
    D12 = np.vstack([np.zeros((1, 2)), np.eye(2)])
    return plant_of(A, B1, B2, C1 * [[1.0], [0.0], [0.0]], np.eye(4), D12=D12)


def full_information(seed):
    A, B1, B2, C1, _ = random_parts(seed)
    D12, D21 = np.vstack([np.zeros((1, 2)), np.eye(2)]), np.vstack([np.zeros((4, 2)), np.eye(2)])
    return plant_of(A, B1, B2, C1, np.vstack([np.eye(4), np.zeros((2, 4))]), D12=D12, D21=D21)


def no_noise(seed):
    A, B1, B2, C1, C2 = random_parts(seed)
    return plant_of(A, B1, B2, C1, C2, D12=np.vstack([np.zeros((1, 2)), np.eye(2)]))


def free_control(seed):
    """One control costs nothing, and there are as many measurements without noise."""
    A, B1, B2, C1, C2 = random_parts(seed)
    return plant_of(A, B1, B2, C1, C2, D12=[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])


def repeated_controls(seed):
    """Two controls do the same, which a high-pass at them cannot tell apart at 0."""
    A, B1, B2, C1, C2 = random_parts(seed)
    return plant_of(A, B1, B2[:, [0, 0]], C1, C2, D21=np.eye(2))


def oscillator(seed):
    """Modes on the axis that no disturbance moves and no output shows, and not strictly proper."""
    A = block_diag([[0.0, 2.0], [-2.0, 0.0]], [[0.0]], [[-1.0]])
    B1, C1 = [[0.0], [0.0], [0.0], [1.0]], [[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]]
    B2, C2 = [[1.0], [0.5], [1.0], [1.0]], [[1.0, 0.0, 1.0, 1.0]]
    return plant_of(A, B1, B2, C1, C2, D12=[[0.0], [1.0]], D21=[[1.0]], D22=[[0.5]])


KINDS = [state_feedback, full_information, no_noise, free_control, repeated_controls, oscillator]


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_singular_plant_is_solved_to_its_infimum(kind, seed):
    plant = kind(seed)
    with pytest.raises(SingularPlantError):
        checked(standard_plant(plant))
    solution = solve(HinfSynthesis(plant))
    assert solution.certificate.holds, solution.certificate.failures
    answer, least = solution.answer, least_by_inequalities(plant)
    # That of a perturbed plant would be above the infimum; where one side is regular, it has one.
    assert np.isnan(answer.least) or answer.least <= (1 + 1e-5) * answer.norm
    assert certified_norm(plant.close(answer.K)) <= answer.norm * (1 + 2e-4)
    # Methods keep 1e-3 from a least level; a perturbation ends when it gains less than 1e-3.
    assert (1 - TOO_HIGH) * least <= answer.norm <= (1 + 3e-3) * least


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", [state_feedback, full_information])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_controller_that_sees_all_states_is_static(kind, seed):
    answer = hinf(kind(seed))
    assert answer.K.nstates == 0
    assert answer.norm <= (1 + 3e-3) * least_by_inequalities(kind(seed))
    assert answer.least >= answer.norm / (1 + 3e-3)  # who sees less does no better


@pytest.mark.cases(2)
@pytest.mark.parametrize("a", [-1.0, 0.0, 1.0, 3.0])
def test_a_state_feedback_in_closed_form(a):
    """x' = a x + w + u, z = (x, u), y = x: u = F x has the norm sqrt(1 + F^2) / |a + F|.

    For a > 0 it is least at F = -1 / a where this stabilises. Else it falls to 1 as F grows.
    """
    plant = plant_of([[a]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [1.0]])
    F = -np.geomspace(1e-3, 1e6, 400_001)
    F = F[a + F < 0]
    least = float((np.sqrt(1 + F**2) / -(a + F)).min())
    assert hinf(plant).norm == pytest.approx(least, rel=3e-3)


def test_fast_poles_are_left_out_where_they_are_not_needed():
    slow, fast = np.diag([-1.0, -2.0]), np.diag([-1e6, -2e6])
    A = np.block([[slow, np.ones((2, 2))], [np.zeros((2, 2)), fast]])
    K = A, np.vstack([np.eye(2), 1e6 * np.eye(2)]), np.ones((1, 4)), np.zeros((1, 2))
    A, B, C, D = without_fast_poles(K, lambda found: len(found[0]) == 2)
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(A)), [-2.0, -1.0])
    gain = D - C @ np.linalg.solve(A, B)
    np.testing.assert_allclose(gain, K[3] - K[2] @ np.linalg.solve(K[0], K[1]))
    s = 1j
    there = D + C @ np.linalg.solve(s * np.eye(2) - A, B)
    exact = K[3] + K[2] @ np.linalg.solve(s * np.eye(4) - K[0], K[1])
    np.testing.assert_allclose(there, exact, rtol=1e-5)
    assert without_fast_poles(K, lambda found: False) is K


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", ["riccati", "sb10ad", "clarabel"])
def test_every_method_perturbs(method):
    plant = no_noise(0)
    solution = solve(HinfSynthesis(plant), method=method)
    assert solution.certificate.holds
    # A conic solver's controllers are made up to 5e-2 above its least level.
    assert solution.answer.norm <= 1.05 * least_by_inequalities(plant)
    assert "perturbed" in solution.message


@pytest.mark.cases(0)
@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
def test_units_of_time_and_signals_do_not_count(units):
    A, B1, B2, C1, C2 = random_parts(3)
    D12 = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    one = plant_of(A, B1, B2, C1, C2, D12=D12)
    scaled = plant_of(units * A, units * B1, units**2 * B2, C1, C2 / units, D12=units * D12)
    assert hinf(scaled).norm == pytest.approx(hinf(one).norm, rel=2e-3)


def test_a_sampled_plant_without_noise():
    A, B1, B2, C1, C2 = random_parts(5)
    D12 = np.vstack([np.zeros((1, 2)), np.eye(2)])
    solution = solve(
        HinfSynthesis(plant_of(0.7 * A, B1, B2, C1, 0 * C2 + [1, 0, 1, 0], D12=D12, dt=0.1))
    )
    assert solution.certificate.holds
    assert solution.answer.K.dt == 0.1


def test_an_infimum_of_zero_is_approached():
    """Free control of a plant without zeros to the right."""
    size = hinf(plant_of([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])).norm
    assert size <= 1e-5
    nothing = solve(MixedSensitivity(1 / (S + 1), W_S=0.0, W_KS=0.0))
    assert nothing.certificate.holds
    assert nothing.answer.norm == 0.0


def test_mixed_sensitivity_without_a_weight_of_u():
    """S(1) = 1 for a zero of G at 1: the least norm of W S is at least |W(1)|, and reaches it."""
    W = (0.5 * S + 1) / (S + 0.01)
    answer = solve(MixedSensitivity((1 - S) / (S + 1) ** 2, W_S=W)).answer
    assert answer.norm == pytest.approx(1.5 / 1.01, rel=2e-3)
    # Of G without zeros to the right only the value at high frequencies is left.
    assert solve(MixedSensitivity(1 / (S + 1), W_S=W)).answer.norm == pytest.approx(0.5, rel=2e-3)


def test_levels_that_are_asked_for():
    plant = no_noise(0)
    least = least_by_inequalities(plant)
    within = solve(HinfSynthesis(plant, gamma=1.1 * least))
    assert within.certificate.holds
    assert within.answer.norm <= within.answer.gamma == 1.1 * least
    below = solve(HinfSynthesis(plant, gamma=0.9 * least))
    assert below.answer is None
    assert below.outcome is Outcome.FAILED  # not infeasible: nothing proves it
    assert "no perturbed plant" in below.message or "perturbed plant has no" in below.message


def test_what_cannot_be_stabilised_is_refused():
    hidden = plant_of(np.diag([1.5, -1.0]), [[1.0], [1.0]], [[0.0], [1.0]], [[1.0, 1.0]], np.eye(2))
    with pytest.raises(InputError, match=r"not stabilisable: no control reaches the mode 1\.5"):
        HinfSynthesis(hidden)
    with pytest.raises(InputError, match=r"not detectable: no measurement shows the mode 1\.5"):
        HinfSynthesis(
            plant_of(np.diag([1.5, -1.0]), np.eye(2), [[1.0], [1.0]], np.eye(2), [[0.0, 1.0]])
        )


@pytest.mark.parametrize("kind", KINDS)
def test_a_plant_made_regular_meets_the_assumptions(kind):
    plant = kind(0)
    for size in (1e-2, 1e-4):
        checked(standard_plant(regularise(plant, size)))
    checked(standard_plant(regularise(plant)))
    given = standard_plant(plant)
    for perturbed in (made_regular, wholly_perturbed):
        found = perturbed(given, 1e-3)
        assert has_rank(found.D12) and has_rank(found.D21.T)
        np.testing.assert_array_equal(found.A, given.A)


def test_a_regular_plant_is_not_touched():
    plant = HinfSynthesis(regularise(no_noise(0), 1e-2)).plant
    given = standard_plant(plant)
    assert made_regular(given) is given


def test_names_of_signals_at_every_frequency():
    labels = regularise(repeated_controls(0)).system.output_labels
    assert [name for name in labels if name.startswith("regular_")] == ["regular_u0", "regular_u1"]


def test_integrators_alone_that_one_control_cannot_part():
    """A = 0 has no size by which a value could count as rounding."""
    plant = plant_of(np.zeros((2, 2)), np.eye(2), [[1.0], [1.0]], np.eye(2), np.eye(2))
    with pytest.raises(InputError, match="not stabilisable"):
        HinfSynthesis(plant)
    silent = plant_of([[0.0]], [[0.0]], [[0.0]], [[1.0]], [[1.0]])
    with pytest.raises(InputError, match="unstable mode 0"):
        HinfSynthesis(silent)


@pytest.mark.cases(0)
def test_mu_synthesis_of_an_integrator_without_a_weight_of_u():
    """At high frequencies S = 1 and the weight is 0.5, which no controller changes."""
    G = tf([real("k", 1, percent=20)], [1, 0])
    plant = generalised_plant(
        [(G, "u", "x"), ((0.5 * S + 1) / (S + 0.01), "e", "z")],
        {"e": "r - x"},
        exogenous=["r"],
        performance=["z"],
        control=["u"],
        measurement="e",
    )
    solution = solve(MuSynthesis(plant), method="dk", options=Options(tolerance="low"))
    assert solution.certificate.holds
    assert 0.5 <= solution.answer.upper <= 0.51


@pytest.mark.parametrize("fast", [1e6, 1e10, 1e12, 3e14])
def test_a_stable_mode_beside_a_very_fast_pole_is_not_hidden(fast):
    """A search may move a pole of a weight far beyond all frequencies, where it has no effect."""
    G = control.tf([4e4], [1.0, 28.0, 4e4])
    weights = control.tf([0.5, 100.0], [1.0, 1.0]), control.tf([0.5 * fast], [1.0, fast])
    plant = MixedSensitivity(G, W_S=weights[0], W_T=weights[1]).plant
    need_stabilisable(standard_plant(plant))
    unstable = control.tf([0.5, 100.0], [1.0, -1.0])
    with pytest.raises(InputError, match=r"not (detectable|stabilisable)"):
        MixedSensitivity(G, W_S=unstable, W_T=weights[1])
