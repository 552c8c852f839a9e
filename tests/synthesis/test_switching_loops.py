"""Loops switched by measurement defects: a heated plate, against closed forms and simulation."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.executor import Context
from workbench.structure import Complex
from workbench.synthesis import (
    Deviations,
    Mode,
    SampledPlant,
    SingleLoops,
    SwitchedBox,
    SwitchedStability,
    closed_loop_transition,
    discretise,
    dropout_modes,
    filtering_modes,
    proven_share,
    replacement_modes,
    switched_loop,
    unswitched_modes,
)
from workbench.synthesis.switching.cells import ParameterCell
from workbench.synthesis.switching.controllers import split_slowest
from workbench.systems.connection import generalised_plant
from workbench.systems.sampling import sampled_model

PERIOD = 0.1
CORNER = 4.0
"""Of the thermometer [rad/s]."""
PLATE = control.ss([[-1.0, 0.0], [CORNER, -CORNER]], [[1.0], [0.0]], np.eye(2), 0)
PI = control.ss([[-0.01, 0.0], [0.0, -5.0]], [[1.0], [2.0]], [[0.8, -0.6]], [[1.2]])
"""Slow pole -0.01, and a lag."""
SLOW = control.ss([[-0.01]], [[1.0]], [[0.2]], [[0.3]])


def thermometer(omega):
    return CORNER / (1j * omega + CORNER)


def plate(delay=0.0):
    P = sampled_model(PLATE, PERIOD, delay_samples=delay)
    return SampledPlant(P.A, P.B, P.C[:1], P.C[1:], 1.0, PERIOD, thermometer)


def pair():
    return [discretise(K, PERIOD) for K in (PI, SLOW)]


def test_a_first_order_loop_by_hand():
    G, K = control.ss(-2.0, 1.0, 1.0, 0.0), control.ss([], [], [], [[3.0]], PERIOD)
    held = np.exp(-2.0 * PERIOD)
    assert closed_loop_transition(G, K, 0.0) == pytest.approx(held - 3.0 * (1 - held) / 2.0)


def test_a_split_controller_responds_alike():
    K, _ = pair()
    a, b, A, B, C, D = split_slowest(K)
    z = np.exp(0.3j)
    fast = (C @ np.linalg.solve(z * np.eye(len(A)) - A, B))[0, 0]
    assert b / (z - a) + fast + D == pytest.approx(complex(K(z)), rel=1e-9)
    with pytest.raises(InputError, match="is coupled with"):
        split_slowest(control.ss([[0.9, 0.1], [0.0, 0.5]], [[1], [1]], [[1, 1]], [[0]], PERIOD))


@pytest.mark.parametrize("case", ["unswitched", "dropped", "filtered", "replaced"])
def test_modes_are_the_controllers_run_one_by_one(case):
    """What each mode makes u is what these controllers give, each with states of its own."""
    K, other = pair()
    F = discretise(control.ss(-3.0, 3.0, 1.0, 0.0), PERIOD)
    modes = {
        "unswitched": unswitched_modes(K),
        "dropped": dropout_modes(K),
        "filtered": filtering_modes(K, F),
        "replaced": replacement_modes(K, other),
    }[case]
    rng = np.random.default_rng(0)
    e, x = rng.standard_normal(60), np.zeros(len(modes[0].A))
    defect = (np.arange(60) // 7) % 2 == 1
    z, f, g, v = 0.0, np.zeros(1), np.zeros(0), np.zeros(1)
    one, two = split_slowest(K), split_slowest(other)
    for k in range(60):
        mode = modes[int(defect[k])]
        u = (mode.C @ x + mode.D[:, 0] * e[k])[0]
        x = mode.A @ x + mode.B[:, 0] * e[k]
        law, fed = one, e[k]
        if defect[k]:
            law = two if case == "replaced" else one
            fed = {"dropped": 0.0, "filtered": (F.C @ v + F.D[:, 0] * e[k])[0]}.get(case, e[k])
        states = g if law is two else f
        assert u == pytest.approx(z + (law.C @ states).sum() + law.D * fed, abs=1e-12)
        z = law.a * z + law.b * fed
        f = one.A @ f + one.B[:, 0] * (e[k] if case == "replaced" else fed)
        g = two.A @ g + two.B[:, 0] * e[k]
        v = F.A @ v + F.B[:, 0] * e[k]


def test_slow_poles_that_differ_are_named():
    K, _ = pair()
    with pytest.raises(InputError, match="slow poles"):
        replacement_modes(K, discretise(control.ss(-0.5, 1.0, 1.0, 0.0), PERIOD))


def deviations(false=0.3, longest=8):
    loop = switched_loop(plate(1.0), dropout_modes(pair()[0]))
    return Deviations(loop, np.array([2.0, 0.5]), np.array([0.5, 3.0]), longest, false)


def test_the_steady_error_is_that_of_the_sampled_loop():
    """Of a disturbance that is known between samples: w - y with y = P K H w / (1 + P_m K)."""
    found = deviations()
    z = np.exp(1j * found.omega * PERIOD)
    P, K = sampled_model(PLATE, PERIOD, delay_samples=1.0)(z), pair()[0](z)
    u = K * thermometer(found.omega) * found.amplitude / (1 + P[1, 0] * K)
    assert found.steady_error == pytest.approx(found.amplitude - P[0, 0] * u, rel=1e-9)


def test_bounds_hold_for_random_defects_and_are_no_wild_guess():
    found = deviations()
    loop = found.loop
    clean, defect = (
        Mode("clean", loop.clean[0], shortest_samples=None),
        Mode("defect", loop.defect[0], shortest_samples=1, longest_samples=8),
    )
    P = wb.solve(SwitchedStability((clean, defect))).answer.P
    bound = found.proven(P, np.array([60]))[-1, 0]
    rng = np.random.default_rng(5)
    worst = 0.0
    for _ in range(30):
        f = rng.integers(len(found.omega))
        phase = np.exp(1j * rng.uniform(0, 2 * np.pi))
        x, turn = (found.steady_phasor[f] * phase).real, phase
        for _ in range(4):
            stays = (rng.integers(1, 9), 60 + rng.integers(9))
            for stay, (A, B) in zip(stays, (loop.defect, loop.clean), strict=True):
                for _ in range(stay):
                    w = found.amplitude[f] * turn
                    worst = max(worst, abs(w.real - float(loop.output[0] @ x)))
                    v = rng.choice([-1, 1]) * found.false if A is loop.defect[0] else 0.0
                    seen = (w * thermometer(found.omega[f])).real
                    x = A @ x + B[:, 0] * (seen + v)
                    turn = turn * found.phase_factor[f]
    assert 0.5 * bound < worst <= bound
    assert found.simulated(8, 60, 5) <= bound


def test_wrong_deviations_are_named():
    loop = switched_loop(plate(), unswitched_modes(pair()[0]))
    with pytest.raises(InputError, match="amplitude has shape"):
        Deviations(loop, np.ones(2), np.ones(3), 1, 0.0)
    with pytest.raises(InputError, match="longest is 0"):
        Deviations(loop, np.ones(2), np.ones(2), 0, 0.0)


# --- a box of first-order plants, x' = -p x + u ---------------------------------------------------


def first_order(low, high, gains, **options):
    """Its loops are a - k b, with a = exp(-p T), b = (1 - a) / p."""

    def plant(p):
        return np.array([[-p[0], 1.0], [0.0, 0.0]])

    def loops(held):
        return tuple(held[:1, :1] - k * held[:1, 1:] for k in gains)

    return SwitchedBox(
        (np.array([low]), np.array([high])), plant, loops, 1.0, **{"parts": (4,)} | options
    )


def exact(p, k):
    a = np.exp(-p)
    return a - k * (1 - a) / p


def test_a_set_holds_every_plant_of_its_cell():
    box = first_order(0.2, 1.0, (0.5, 0.0))
    cell = ParameterCell(np.array([0.3]), np.array([0.7]))
    for each, k in zip(box.sets(cell), (0.5, 0.0), strict=True):
        for p in np.linspace(0.3, 0.7, 9):
            assert box.at(np.array([p]))[k == 0.0].item() == pytest.approx(exact(p, k))
            low, high = each.vertices.min(), each.vertices.max()
            assert low - each.remainder.item() <= exact(p, k) <= high + each.remainder.item()


def test_stable_modes_are_proven_for_any_switching():
    done, given_up = first_order(0.2, 1.0, (0.5, 0.0)).proven(Context())
    assert not given_up
    assert [one.dwell for one in done] == [1] * 4
    assert sum(one.cell.volume for one in done) == pytest.approx(0.8)


@pytest.mark.cases(0)
def test_the_proven_share_ends_where_a_mode_is_unstable():
    """Without control the plant is unstable for p <= 0: half of the box, and a cell that has 0."""

    def box(share):
        return first_order(-0.5 * share, 0.5 * share, (0.5, 0.0), halved=(0, 0))

    found = proven_share(box, (1.0, 2.0), Context())
    assert found.volumes == pytest.approx([0.25 + 0.125 + 0.0625])
    low, high = (np.sort(end[:, 0]) for end in (found.low, found.high))
    assert low == pytest.approx([0.0625, 0.125, 0.25])
    assert high == pytest.approx([0.125, 0.25, 0.5])


def test_halves_fill_their_cell():
    cell = ParameterCell(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    for along in range(3):
        low, high = sorted(cell.halves(along), key=lambda half: half.low[along])
        assert low.volume + high.volume == pytest.approx(cell.volume)
        assert low.high[along] == high.low[along]


@pytest.mark.parametrize(
    ("low", "options", "words"),
    [
        (2.0, {}, "the first must be below"),
        (0.0, {"parts": (1, 2)}, "parts are"),
        (0.0, {"halved": (1,)}, "halved is"),
        (0.0, {"dwells": (3, 1)}, "dwells are"),
        (-np.inf, {}, "must be finite"),
    ],
)
def test_wrong_boxes_are_named(low, options, words):
    with pytest.raises(InputError, match=words):
        first_order(low, 1.0, (0.5, 0.0), **options)


# --- each loop alone: an integrator with a gain ---------------------------------------------------


def static(gains, dt):
    return {f"{k:g}": control.ss([], [], [], [[k]], dt) for k in gains}


def test_an_integrator_alone_has_its_closed_forms():
    G, gains, T = control.ss(0.0, 40.0, 1.0, 0.0), (1.0, 6.0), 0.01
    K = static(gains, 0)
    found = SingleLoops(K, static(gains, T), {"tank": G}, 0.0).margins()
    for i, k in enumerate(gains):
        assert found.growth[i, 0, 0] == pytest.approx(-40.0 * k)
        assert found.growth[i, 1, 0] == pytest.approx(np.log(abs(1 - 40.0 * k * T)) / T)
        assert found.phase_deg[i, 0, 0] == pytest.approx(90.0)
    assert np.isnan(found.phase_deg[1, 1, 0])  # unstable when sampled


def test_robust_stability_of_an_uncertain_gain():
    """mu is 0.4 max |T| for G (1 + 0.4 delta): 0.4 for an integrator, more with the delay."""
    G = control.ss(0.0, 2.0, 1.0, 0.0)
    plant = generalised_plant(
        [(G, "v", "y"), (control.ss([], [], [], [[0.4]]), "u", "z")],
        {"v": "u + d", "e": "w - y"},
        perturbation=[(Complex(1), "z", "d")],
        exogenous=["w"],
        performance=["e"],
        control=["u"],
        measurement="e",
    )
    loops = SingleLoops(static([3.0], 0), static([3.0], 0.1), {"tank": G}, 0.5)
    mu = loops.robust(plant, Context())
    assert mu.shape == (1, 2, 2)
    assert mu[0, 0, 0] <= 0.4 <= mu[0, 0, 1] * (1 + 1e-9)
    assert mu[0, 1, 0] > 0.41
    with pytest.raises(InputError, match="need the names"):
        SingleLoops(static([3.0], 0), {}, {"tank": G}, 0.5)
