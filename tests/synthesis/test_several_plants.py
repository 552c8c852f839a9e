"""One controller for several plants, and limits of its gain, against scans of closed forms."""

import math

import control
import numpy as np
import pytest
from scipy.optimize import minimize

import workbench as wb
from workbench.errors import InputError
from workbench.structure import Complex
from workbench.synthesis import (
    PI,
    PID,
    H2Synthesis,
    HinfSynthesis,
    MixedSensitivity,
    MuSynthesis,
    Static,
)
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import generalised_plant

LAGS = ((1.0, 1.0, 0.1), (-1.0, 1.0, 3.0), (0.2, 0.5, 0.4))
"""Pole a, gain b and weight r of the control: x' = a x + b u + d, z = (x, r u)."""
GAINS = -np.linspace(1.01, 12.0, 60001)


def lag(a, b, r):
    D = np.zeros((3, 2))
    D[1, 1] = r
    system = control.ss([[a]], [[1.0, b]], [[1.0], [0.0], [1.0]], D)
    return GeneralisedPlant(system, None, 1, 1)


PLANTS = [lag(*each) for each in LAGS]


def largest(size):
    """The largest of a closed form over the lags, at every gain."""
    rates = [-a - b * GAINS for a, b, _ in LAGS]
    sizes = [
        np.where(rate > 0, size(rate, r), np.inf)
        for rate, (_, _, r) in zip(rates, LAGS, strict=True)
    ]
    return np.max(sizes, axis=0)


HINF = largest(lambda rate, r: np.sqrt(1 + (r * GAINS) ** 2) / np.maximum(rate, 1e-9))
H2 = largest(lambda rate, r: np.sqrt((1 + (r * GAINS) ** 2) / (2 * np.maximum(rate, 1e-9))))


@pytest.mark.cases(1)
@pytest.mark.parametrize(("make", "sizes"), [(HinfSynthesis, HINF), (H2Synthesis, H2)])
def test_a_gain_for_three_lags_is_that_of_a_scan(make, sizes):
    solution = wb.solve(make(PLANTS[0], family=Static(), further_plants=PLANTS[1:]))
    assert solution.holds
    assert solution.answer.norm == pytest.approx(sizes.min(), rel=2e-4)
    assert solution.answer.K.D[0, 0] == pytest.approx(GAINS[sizes.argmin()], rel=5e-2)


@pytest.mark.cases(0)
@pytest.mark.parametrize(("make", "sizes"), [(HinfSynthesis, HINF), (H2Synthesis, H2)])
def test_a_limited_gain_is_that_of_a_scan_within_the_limit(make, sizes):
    most = 0.5 * (2.0 - GAINS[sizes.argmin()])
    allowed = np.where(most >= -GAINS, sizes, np.inf)
    program = make(PLANTS[0], family=Static(), further_plants=PLANTS[1:], largest_gain=most)
    solution = wb.solve(program)
    assert solution.holds and any("largest gain" in c.name for c in solution.certificate.checks)
    assert abs(solution.answer.K.D[0, 0]) <= most
    assert solution.answer.norm == pytest.approx(allowed.min(), rel=2e-3)
    K = control.ss([], [], [], [[-1.01 * most]])
    assert not program.certify(type(solution.answer)(K, 1e3, **gamma_of(make)), 1e-6).holds


def gamma_of(make):
    return {"gamma": 1e3} if make is HinfSynthesis else {}


def test_the_norm_is_the_largest_of_all_plants_by_slicot():
    solution = wb.solve(HinfSynthesis(PLANTS[0], order=1, further_plants=PLANTS[1:]))
    assert solution.holds
    sizes = [control.linfnorm(plant.close(solution.answer.K))[0] for plant in PLANTS]
    assert solution.answer.norm == pytest.approx(max(sizes), rel=2e-4)
    static = HINF.min()
    assert solution.answer.norm <= static * (1 + 1e-3)


@pytest.mark.slow
def test_mu_of_several_plants_is_the_largest_peak():
    s = control.tf("s")

    def uncertain(gain):
        return generalised_plant(
            [(gain / (s + 1), "v", "y"), (0.3, "u", "z"), ((0.4 * s + 1) / (s + 0.01), "e", "z_e")],
            {"v": "u + d", "e": "r - y"},
            perturbation=[(Complex(1), "z", "d")],
            exogenous=["r"],
            performance=["z_e"],
            control=["u"],
            measurement="e",
        )

    plants = [uncertain(gain) for gain in (1.0, 1.6)]
    solution = wb.solve(MuSynthesis(plants[0], family=PI(), further_plants=plants[1:]))
    assert solution.holds
    each = [MuSynthesis(plant, family=PI()).certified_peak(solution.answer.K) for plant in plants]
    assert solution.answer.upper == pytest.approx(max(one.upper for one in each), rel=2e-3)
    alone = [wb.solve(MuSynthesis(plant, family=PI())).answer.upper for plant in plants]
    assert solution.answer.upper >= max(alone) * (1 - 2e-3)


@pytest.mark.slow
def test_a_pid_for_three_plants_is_as_good_as_the_best_of_a_search_without_slopes():
    s = control.tf("s")
    weights = {"W_S": (0.5 * s + 1) / (s + 0.001), "W_KS": 0.1 * (s + 1) / (0.01 * s + 1)}
    plants = [
        MixedSensitivity(
            gain * (1 - lag * s / 2) / (1 + lag * s / 2) / (T * s + 1), **weights
        ).plant
        for gain, T, lag in ((1.0, 1.0, 0.1), (1.5, 1.0, 0.15), (0.7, 1.4, 0.1))
    ]
    solution = wb.solve(HinfSynthesis(plants[0], family=PID(), further_plants=plants[1:]))
    assert solution.holds

    def size(x):
        P, integral, D = x[:3]
        T = math.exp(min(max(x[3], -8.0), 5.0))
        K = control.ss(control.tf([P * T + D, P + integral * T, integral], [T, 1.0, 0.0]))
        found = 0.0
        for plant in plants:
            loop = plant.close(K)
            if loop.poles().real.max() >= -1e-9:
                return 1e3
            found = max(found, control.linfnorm(loop)[0])
        return found

    starts = ([1.0, 1.0, 0.1, -3.0], [1.2, 1.4, -0.1, -2.0], [2.0, 2.0, 0.1, -4.0])
    options = {"maxfev": 300, "fatol": 1e-6}
    best = min(minimize(size, x, method="Nelder-Mead", options=options).fun for x in starts)
    assert solution.answer.norm <= 1.005 * best


@pytest.mark.cases(0)
def test_a_pi_of_a_sampled_plant_is_the_trapezoidal_one():
    dt = 0.1
    plants = []
    for gain in (1.0, 1.5):
        G = control.sample_system(control.ss(control.tf([gain], [1.0, 1.0])), dt)
        W = control.sample_system(control.ss(control.tf([0.5, 0.5], [1.0, 0.01])), dt, "tustin")
        plants.append(MixedSensitivity(G, W_S=W, W_KS=0.2).plant)
    solution = wb.solve(HinfSynthesis(plants[0], family=PI(), further_plants=plants[1:]))
    assert solution.holds and solution.answer.K.dt == dt
    K = solution.answer.K
    z = np.exp(1j * np.array([0.5, 2.0, 9.0]) * dt)
    values = np.array([complex(K(one)) for one in z])
    rule = dt / 2 * (z + 1) / (z - 1)
    P, integral = np.linalg.lstsq(
        np.vstack(
            [np.column_stack([np.ones(3), rule.real]), np.column_stack([0 * z, rule.imag]).real]
        ),
        np.concatenate([values.real, values.imag]),
        rcond=None,
    )[0]
    np.testing.assert_allclose(P + integral * rule, values, rtol=1e-6)

    def size(x):
        controller = control.ss(
            control.tf([x[0] + x[1] * dt / 2, x[1] * dt / 2 - x[0]], [1, -1], dt)
        )
        loops = [plant.close(controller) for plant in plants]
        if max(np.abs(loop.poles()).max() for loop in loops) >= 1.0:
            return 1e3
        omega = np.geomspace(1e-3, np.pi / dt, 400)
        return max(
            np.linalg.norm(
                loop.frequency_response(omega).complex.transpose(2, 0, 1), 2, (1, 2)
            ).max()
            for loop in loops
        )

    best = minimize(size, [P, integral], method="Nelder-Mead", options={"maxfev": 60}).fun
    assert solution.answer.norm <= 1.003 * best


@pytest.mark.parametrize(
    ("further", "said"),
    [
        (PLANTS[1], r"write \(plant,\)"),
        ("plants", "not str"),
        (3, "not int"),
        ([PLANTS[1], LAGS], "further plant 2 is a tuple"),
        (
            [GeneralisedPlant(control.ss([], [], [], np.eye(3)), None, 2, 1)],
            "has 1 measurements, 2",
        ),
        ([GeneralisedPlant(control.ss([], [], [], np.eye(2), 0.1), None, 1, 1)], "dt = 0.1"),
        ([GeneralisedPlant(control.ss([], [], [], np.eye(1)), None, 1, 1)], "0 exogenous"),
        ([lag(1.0, 0.0, 1.0)], "further plant 1: .*stabilisable"),
    ],
)
@pytest.mark.parametrize("make", [HinfSynthesis, H2Synthesis])
def test_what_no_further_plants_are(make, further, said):
    with pytest.raises(InputError, match=said):
        make(PLANTS[0], family=Static(), further_plants=further)


@pytest.mark.parametrize("make", [HinfSynthesis, H2Synthesis])
def test_several_plants_need_a_form_and_a_start_for_all(make):
    with pytest.raises(InputError, match="further_plants need order, family or start"):
        make(PLANTS[0], further_plants=PLANTS[1:])
    with pytest.raises(InputError, match="does not stabilise further plant 2"):
        make(PLANTS[0], family=Static(), start=[-1.1], further_plants=[PLANTS[1], lag(1.2, 1.0, 1)])
    with pytest.raises(InputError, match="any largest_gain"):
        MuSynthesis(PLANTS[0], order=1, integral=True, largest_gain=1.0)
