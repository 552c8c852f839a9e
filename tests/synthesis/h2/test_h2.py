"""H2 controllers against closed forms, other solvers, sums over samples and searches."""

import math

import control
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize

import workbench as wb
from workbench.errors import InputError, SolverError
from workbench.solvers import Outcome
from workbench.synthesis import PID, H2Synthesis, Static, lqg
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import generalised_plant


def random_plant(seed, dt=0.0, states=4, direct=True, scale=1.0):
    """A random plant of three exogenous inputs and performance outputs, two controls each way."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(states, states)) * (0.5 if dt else 1.0)
    D = np.zeros((5, 5))
    D[:3, 3:], D[3:, :3], D[3:, 3:] = (rng.normal(size=shape) for shape in ((3, 2), (2, 3), (2, 2)))
    if direct:
        D[:3, :3] = D[:3, 3:] @ rng.normal(size=(2, 2)) @ D[3:, :3]
    if dt:
        D[:3, :3] = rng.normal(size=(3, 3))
    B, C = rng.normal(size=(states, 5)), rng.normal(size=(5, states))
    system = control.ss(A * scale, B * math.sqrt(scale), C * math.sqrt(scale), D, dt)
    return GeneralisedPlant(system, None, 2, 2)


@pytest.mark.parametrize("method", [None, "sb10hd", "clarabel", "scs"])
def test_two_states_in_a_row_have_the_norm_of_the_closed_form(method):
    # Doyle's example with q = sigma = 1 at rho: regulator and filter of x'' = u + w, y = x + v
    A, B = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]]
    plant = control.ss(A, [[0, 0, 0], [1, 0, 1]], [[1, 0], [0, 0], [1, 0]],
                       [[0, 0, 0], [0, 0, 1], [0, 1, 0]])  # fmt: skip
    solution = wb.solve(H2Synthesis(GeneralisedPlant(plant, None, 1, 1)), method=method)
    # X = Y' = [[r2, 1], [1, r2]], F = [-1, -r2], so that J = tr(B1' X B1) + F Y F' = 6 r2
    assert solution.holds and solution.answer.norm**2 == pytest.approx(6 * math.sqrt(2), rel=1e-6)
    assert B and solution.answer.K.nstates == 2


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(6))
def test_no_neighbour_of_the_controller_is_better(seed, dt):
    program = H2Synthesis(random_plant(seed, dt))
    answer = wb.solve(program).answer
    assert answer.norm == pytest.approx(answer.least, rel=1e-6)
    rng = np.random.default_rng(100 + seed)
    K = answer.K
    for _ in range(20):
        size = 10 ** rng.uniform(-4, -1)
        A, B, C = (part * (1 + size * rng.normal(size=part.shape)) for part in (K.A, K.B, K.C))
        D = K.D * (1 + size * rng.normal(size=K.D.shape)) if dt else K.D
        other = program.answer(control.ss(A, B, C, D, dt))
        assert other is None or other.norm >= answer.norm * (1 - 1e-9)


@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_methods_agree(dt):
    for seed in range(3):
        program = H2Synthesis(random_plant(seed, dt))
        norms = [wb.solve(program, method=name).answer.norm for name in ("riccati", "clarabel")]
        if not dt:
            norms.append(wb.solve(program, method="sb10hd").answer.norm)
        np.testing.assert_allclose(norms, norms[0], rtol=1e-4)


def test_the_norm_is_the_root_mean_square_of_a_simulation():
    plant = random_plant(3, 0.1)
    answer = wb.solve(H2Synthesis(plant)).answer
    loop = plant.close(answer.K)
    rng = np.random.default_rng(7)
    P = solve_discrete_lyapunov(loop.A, loop.B @ loop.B.T)
    noise = rng.normal(size=(20000, 3))
    x, total = np.linalg.cholesky(P + 1e-12 * np.eye(len(P))) @ rng.normal(size=len(P)), 0.0
    for w in noise:
        z = loop.C @ x + loop.D @ w
        total += z @ z
        x = loop.A @ x + loop.B @ w
    assert math.sqrt(total / len(noise)) == pytest.approx(answer.norm, rel=0.05)


@pytest.mark.cases(0)
@given(st.integers(0, 10**6), st.floats(-8, 8))
@settings(max_examples=15, deadline=None)
def test_the_unit_of_time_changes_the_norm_by_its_root(seed, log):
    rate = 10.0**log
    slow, fast = (wb.solve(H2Synthesis(random_plant(seed, scale=each))) for each in (1.0, rate))
    if slow.answer is None:
        return
    assert fast.holds
    assert fast.answer.norm == pytest.approx(math.sqrt(rate) * slow.answer.norm, rel=1e-5)


def servo():
    """A mass with a spring under a slow disturbance at its input."""
    G, slow = control.tf([1.0], [1.0, 0.3, 1.0]), control.tf([1.0], [1.0, 0.02])
    return generalised_plant(
        [(G, "v", "x"), (slow, "w", "d"), (control.tf([0.1, 0.1], [0.01, 1.0]), "u", "z_u")],
        {"v": "u + d", "e": "-x"},
        exogenous=["w"],
        performance=["x", "z_u"],
        control=["u"],
        measurement="e",
    )


@pytest.mark.cases(0)
def test_a_pid_is_as_good_as_the_best_of_a_search_without_slopes():
    plant = servo()

    def size(x):
        P, integral, D, log = x
        T = math.exp(min(max(log, -8.0), 8.0))
        K = control.ss(control.tf([P * T + D, P + integral * T, integral], [T, 1.0, 0.0]))
        loop = plant.close(K)
        if loop.poles().real.max() >= -1e-9:
            return 1e6
        return min(float(control.norm(loop, 2)), 1e6)

    best = min(
        minimize(size, start, method="Nelder-Mead", options={"maxfev": 250, "fatol": 1e-6}).fun
        for start in ([1.0, 0.5, 1.0, -3.0], [3.0, 1.0, 2.0, -5.0])
    )
    solution = wb.solve(H2Synthesis(plant, family=PID()))
    assert solution.holds
    assert solution.answer.norm <= 1.005 * best


@pytest.mark.cases(0)
@pytest.mark.parametrize("order", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_of_a_higher_order_the_norm_is_no_larger_and_the_distance_is_told(order):
    norms = [wb.solve(H2Synthesis(servo(), order=each)) for each in (order, order + 1)]
    few, more = norms
    assert few.holds and few.answer.K.nstates <= order
    assert more.answer.norm <= few.answer.norm * 1.001
    every = few.answer.least
    if not math.isnan(every):
        assert few.answer.norm >= every * (1 - 1e-6)
        assert any("distance" in said for said in few.certificate.facts)


@pytest.mark.cases(0)
def test_a_gain_of_a_sampled_plant_is_that_of_a_scan():
    plant = servo()
    system = control.sample_system(plant.system, 0.1, "tustin")
    sampled = GeneralisedPlant(system, None, plant.controls, plant.measurements)
    program = H2Synthesis(sampled, order=0)
    solution = wb.solve(program)
    gains = np.geomspace(0.1, 100.0, 200)
    scanned = [program.answer(control.ss([], [], [], [[k]], 0.1)) for k in gains]
    best = min(one.norm for one in scanned if one is not None)
    assert solution.holds and best / 1.01 <= solution.answer.norm <= best * (1 + 1e-6)


# --- LQG --------------------------------------------------------------------------------------


def test_lqg_is_made_of_regulator_and_filter_of_another_library():
    A, B, C = np.array([[0.0, 1.0], [2.0, -0.5]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    Q, R, W, V = np.diag([2.0, 1.0]), 0.5, np.diag([0.1, 1.0]), 0.2
    answer = lqg(control.ss(A, B, C, 0), Q, R, W, V)
    F, X, _ = control.lqr(A, B, Q, [[R]])
    L, Y, _ = control.lqe(A, np.eye(2), C, W, [[V]])
    K = control.ss(A - B @ F - L @ C, L, -F, 0)
    at = 1j * np.geomspace(0.01, 100, 30)
    np.testing.assert_allclose(answer.K(at), K(at), rtol=1e-6)
    assert answer.norm**2 == pytest.approx(np.trace(X @ W) + float(np.trace(F @ Y @ F.T)) * R)


def test_a_sampled_lqg_answers_to_the_newest_measurement():
    A, B, C = np.array([[1.0, 0.1], [0.0, 0.9]]), np.array([[0.0], [0.1]]), np.array([[1.0, 0.0]])
    answer = lqg(control.ss(A, B, C, 0, 0.1), np.eye(2), 1.0, 0.01 * np.eye(2), 0.04)
    F, X, _ = control.dlqr(A, B, np.eye(2), [[1.0]])
    Y = solve_discrete_are(A.T, C.T, 0.01 * np.eye(2), [[0.04]])  # of the prediction's error
    filtered = Y - Y @ C.T @ np.linalg.inv(C @ Y @ C.T + 0.04) @ C @ Y
    cost = np.trace(X @ (0.01 * np.eye(2))) + np.trace((B.T @ X @ B + 1.0) @ F @ filtered @ F.T)
    assert answer.norm**2 == pytest.approx(float(cost), rel=1e-6)
    assert answer.K.D[0, 0] != 0.0


def riccati_in_digits(A, B, Q, R):
    """X = A'X (1 + G X)^-1 A + Q with G = B B' / R, by doubling in 400 bits."""
    with flint.ctx.workprec(400):
        a, b, X = (flint.arb_mat(part.tolist()) for part in (A, B, Q))
        one, G = flint.arb_mat(np.eye(len(A)).tolist()), b * b.transpose() / R
        for _ in range(60):
            between = (one + G * X).inv()
            G = (G + a * between * G * a.transpose()).mid()
            X, a = (X + a.transpose() * X * between * a).mid(), (a * between * a).mid()
        return np.array([[float(x) for x in row] for row in X.tolist()])


@pytest.mark.parametrize("dt", [0.01, 1e-3])
@pytest.mark.parametrize("den", [[1, 0.2, 1], [1, 0, 0], [1, 1, 0], [1, 0, -1]])
def test_a_transfer_function_that_is_sampled_fast_has_its_lqg(den, dt):
    """Its states are nearly parallel; SciPy's sorted QZ form fails for most of these."""
    G = control.ss(control.sample_system(control.tf([1], den), dt))
    answer = lqg(G, 1.0, 1.0, 1.0, 1.0)
    A, B, C = G.A, G.B, G.C
    X, Y = riccati_in_digits(A, B, np.eye(2), 1.0), riccati_in_digits(A.T, C.T, np.eye(2), 1.0)
    F = B.T @ X @ A / (1.0 + B.T @ X @ B)
    filtered = Y - Y @ C.T @ C @ Y / (C @ Y @ C.T + 1.0)
    cost = np.trace(X) + float((F @ filtered @ F.T * (B.T @ X @ B + 1.0))[0, 0])
    assert answer.norm**2 == pytest.approx(cost, rel=1e-5) and answer.holds


@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1e10])
def test_units_of_signals_do_not_count_for_weights(unit):
    """A variance of nanometres, in square metres, beside one of volts was refused as 0."""
    A, B, C = np.diag([0.5, -1.0]), np.array([[1.0, 0.2], [0.3, 1.0]]), np.eye(2)
    R, V = np.array([[1.0, 0.3], [0.3, 0.5]]), np.array([[0.1, 0.02], [0.02, 0.2]])
    scale = np.diag([1.0, unit])
    back = np.linalg.inv(scale)
    answer = lqg(
        control.ss(A, B @ back, scale @ C, 0), 1.0, back @ R @ back, 1.0, scale @ V @ scale
    )
    F, X, _ = control.lqr(A, B, np.eye(2), R)
    _, Y, _ = control.lqe(A, np.eye(2), C, np.eye(2), V)
    assert answer.norm**2 == pytest.approx(np.trace(X) + np.trace(R @ F @ Y @ F.T))


def test_recovery_brings_the_loop_to_that_of_full_information():
    G = control.ss([[0.0, 1.0], [-3.0, -4.0]], [[0.0], [1.0]], [[2.0, 1.0]], 0)
    Q = 80 * np.array([[35.0**2, 35.0], [35.0, 1.0]]) / 35
    F, *_ = control.lqr(G.A, G.B, Q, [[1.0]])
    at = 1j * np.geomspace(0.1, 10, 20)
    wanted = control.ss(G.A, G.B, F, 0)(at)
    W = 61.0 * np.array([[35.0], [-61.0]]) @ np.array([[35.0, -61.0]]) / 61
    distances = [
        np.abs(-lqg(G, Q, 1.0, W, 1.0, recovery=q).K(at) * G(at) / wanted - 1.0).max()
        for q in (0.0, 1e3, 1e5, 1e7, 1e9)
    ]
    assert distances == sorted(distances, reverse=True) and distances[-1] < 0.02


# --- bad input --------------------------------------------------------------------------------


def test_a_direct_term_that_no_control_cancels_is_named():
    plant = random_plant(0)
    D = plant.system.D.copy()
    D[1, 2] += 1.0
    system = control.ss(plant.system.A, plant.system.B, plant.system.C, D)
    with pytest.raises(InputError, match="exogenous input 3 passes directly to performance output"):
        H2Synthesis(GeneralisedPlant(system, None, 2, 2))


def test_a_mode_that_no_control_reaches_is_named():
    system = control.ss(np.diag([1.0, -1.0]), [[1, 0], [1, 1]], [[1, 1], [0, 1]], 0)
    with pytest.raises(InputError, match="not stabilisable"):
        H2Synthesis(GeneralisedPlant(system, None, 1, 1))


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ({"Q": np.eye(3)}, r"Q has shape \(3, 3\); for 2 states \(2, 2\) is needed"),
        ({"Q": [[1.0, 2.0], [0.0, 1.0]]}, "Q is not symmetric"),
        ({"Q": -1.0}, "Q must be positive semidefinite; its least eigenvalue is -1"),
        ({"Q": [[1.0, 0.0], [0.0, -1e-12]]}, "semidefinite; its least eigenvalue is -1e-12"),
        ({"Q": [[1e-20, 1e-20], [1e-20, 0.0]]}, "Q must be positive semidefinite"),
        ({"W": [[1.0, 0.0], [1e-6, 1e-10]]}, "W is not symmetric"),
        ({"R": 0.0}, "R must be positive definite; it is singular"),
        ({"R": np.eye(2)}, "R has shape"),
        ({"W": "big"}, "W"),
        ({"W": [[np.nan, 0], [0, 1]]}, "W"),
        ({"V": [[-1.0]]}, "V must be positive definite"),
        ({"V": [1.0, 2.0]}, "V has shape"),
        ({"recovery": -1.0}, "recovery is -1.0"),
        ({"recovery": "much"}, "recovery is 'much'"),
    ],
)
def test_weights_that_are_none_are_named(weights, words):
    G = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0)
    given = {"Q": 1.0, "R": 1.0, "W": 1.0, "V": 1.0} | weights
    with pytest.raises(InputError, match=words):
        lqg(G, **given)


def test_a_plant_without_states_of_its_own_is_refused():
    with pytest.raises(InputError, match=r"Q and W belong to its states.*control\.ss\(plant\)"):
        lqg(control.tf([1.0], [1.0, 2.0]), 1.0, 1.0, 1.0, 1.0)


def test_a_gain_that_does_not_exist_is_said_to_be_infeasible():
    system = control.ss([[0, 1], [0, 0]], [[0, 0], [1, 1]], [[1, 0], [1, 0]], 0)
    solution = wb.solve(H2Synthesis(GeneralisedPlant(system, None, 1, 1), family=Static()))
    assert solution.outcome is Outcome.INFEASIBLE and solution.certificate.holds


def test_a_cost_that_the_regulator_does_not_see_is_no_riccati_equation():
    G = control.ss([[0.0]], [[1.0]], [[1.0]], 0)
    with pytest.raises((SolverError, InputError)):
        lqg(G, 0.0, 1.0, 1.0, 1.0)
