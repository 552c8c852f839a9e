"""Magnitude fits: certified, better than SB10YD, in every order, and their invariances."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes import thinned
from matplotlib.backends.backend_agg import FigureCanvasAgg
from workbench.plants.cd_drive.drive.plants import responses

from workbench.errors import InputError, SolverError
from workbench.fitting.magnitude import sb10yd as magnitude_sb10yd  # noqa: F401
from workbench.fitting.magnitude.program import MagnitudeFit, fit_magnitude
from workbench.fitting.rational import Rational
from workbench.geometry import smallest_circle
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Outcome

OMEGA = np.geomspace(1, 1e4, 200)
LEVEL = np.log(OMEGA / 100)
V = np.exp(np.abs(LEVEL) / 2)


def drives(axis):
    """Relative radii of the circles around the twelve drives."""
    frequency = np.geomspace(5, 5000, 400)
    circle = smallest_circle(responses(axis, frequency).T)
    return 2 * np.pi * frequency, circle.radius / np.abs(circle.center)


MADE = {
    "V": V,
    "step": np.where(LEVEL < 0, 1.0, 10.0),
    "noise": np.exp(0.3 * np.random.default_rng(0).normal(size=OMEGA.size)),
}
BATTERY = ["focus", "radial", *MADE]


@cache
def battery(name):
    """Frequencies [rad/s] and magnitudes, of an axis of the drives or made."""
    return (OMEGA, MADE[name]) if name in MADE else drives(name)


def random_rational(seed, order):
    """Zeros and poles over five decades, some lightly damped."""
    rng = np.random.default_rng(seed)

    def roots():
        found = []
        while len(found) < order:
            size = 10 ** rng.uniform(0, 5)
            if order - len(found) >= 2 and rng.random() < 0.6:
                damping = 10 ** rng.uniform(-3, 0)
                root = size * (-damping + 1j * np.sqrt(1 - damping**2))
                found += [root, root.conjugate()]
            else:
                found.append(-size)
        return np.array(found, dtype=complex)

    return Rational(roots(), roots(), 10 ** rng.uniform(-3, 3))


def size_of(system, omega):
    return np.abs(np.asarray(system(1j * omega)))


@pytest.mark.parametrize("order", thinned([4, 1, 2, 5], 2))
@pytest.mark.parametrize("name", thinned(BATTERY, 2))
def test_the_default_is_optimal_and_no_worse_than_sb10yd(name, order):
    program = MagnitudeFit(*battery(name), order)
    best, peer = solve(program), solve(program, method="sb10yd")
    assert best.outcome is Outcome.SOLVED, best.certificate
    assert best.message == "minimax, proven optimal"
    assert program.error(best.answer) <= program.error(peer.answer) * (1 + 1e-9)


@pytest.mark.parametrize("order", thinned(range(11), 3))
def test_every_order_is_valid_and_no_worse_than_the_last(order):
    program = MagnitudeFit(OMEGA, V, order)
    solution = solve(program)
    assert solution.certificate.valid, solution.certificate
    lower = solve(program.with_order(max(order - 1, 0)))
    assert program.error(solution.answer) <= program.error(lower.answer) * (1 + 1e-6)


@pytest.mark.parametrize("seed", thinned(range(3), 3))
@pytest.mark.parametrize("order", range(1, 11))
def test_rational_magnitudes_are_recovered(order, seed):
    omega = np.geomspace(1, 1e5, 400)
    truth = random_rational(seed, order)
    magnitude = np.abs(truth.response(omega))
    program = MagnitudeFit(omega, magnitude, order)
    solution = solve(program)
    assert solution.outcome is Outcome.SOLVED
    assert program.error(solution.answer) < 1e-9
    system = fit_magnitude(omega, magnitude, order=order)
    assert system.nstates <= order
    # a state-space model holds some 13 digits of dynamic range, not the 29 of these data
    rounding = 1e-13 * magnitude.max()
    np.testing.assert_allclose(size_of(system, omega), magnitude, rtol=1e-6, atol=rounding)
    assert np.all(system.poles().real < 0)


@pytest.mark.parametrize("name", thinned(BATTERY, 2))
@pytest.mark.parametrize("method", ["best", "sb10yd", "sk", "ipopt"])
def test_covers_cover_between_the_data_too(name, method):
    omega, magnitude = battery(name)
    program = MagnitudeFit(omega, magnitude, 3, cover=True)
    solution = solve(program, method=method)
    assert solution.certificate.valid, solution.certificate
    assert solution.outcome is Outcome.SOLVED
    fine = np.geomspace(omega[0], omega[-1], 20001)
    data = np.exp(np.interp(np.log(fine), np.log(omega), np.log(magnitude)))
    covered = size_of(solution.answer.state_space(), fine) / data
    assert covered.min() >= 1 - 1e-9
    assert program.metrics(solution.answer)["cover_margin"] >= 0


@pytest.mark.cases(1)
@pytest.mark.parametrize(("name", "error"), [("first", 1.0913195), ("later", 1.0923205)])
def test_a_cover_whose_plain_fit_is_zero_between_the_data_is_proven_optimal(name, error):
    """Radii of a stadium cover of the drives on a refined grid, and stretched by eight decades.

    The plain fit that a search starts from has a zero between the frequencies; from there it ended
    at three times the least error, or at 1e4 times.
    """
    data = np.load(Path(__file__).parent / "data" / "stadium_radii.npz")
    omega, magnitude, weight = (data[f"{name}_{one}"] for one in ("omega", "magnitude", "weight"))
    program = MagnitudeFit(omega, magnitude, 4, weight=weight, cover=True)
    solution = solve(program)
    assert solution.certificate.holds, solution.certificate
    assert program.error(solution.answer) == pytest.approx(error, rel=1e-4)


def test_a_cover_has_the_shape_of_the_fit_where_the_data_are_dense():
    """Ratio bound T: relative error (T - 1) / (T + 1), of a cover T - 1."""
    programs = [MagnitudeFit(OMEGA, V, 2, cover=cover) for cover in (False, True)]
    fit, cover = (program.error(solve(program).answer) for program in programs)
    assert cover == pytest.approx((1 + fit) / (1 - fit) - 1, rel=1e-3)


@settings(derandomize=True, deadline=None, max_examples=6)
@given(st.floats(-6, 6), st.floats(-3, 3))
def test_scaling_of_magnitude_and_frequency(gain, time):
    gain, time = 10**gain, 10**time
    plain = solve(MagnitudeFit(OMEGA, V, 2)).answer
    scaled = solve(MagnitudeFit(time * OMEGA, gain * V, 2)).answer
    assert scaled.gain == pytest.approx(gain * plain.gain, rel=1e-5)
    np.testing.assert_allclose(scaled.poles, time * plain.poles, rtol=1e-5)
    np.testing.assert_allclose(scaled.zeros, time * plain.zeros, rtol=1e-5)


@settings(derandomize=True, deadline=None, max_examples=6)
@given(st.integers(0, 1000), st.integers(0, 3))
def test_the_inverse_magnitude_has_the_inverse_fit(seed, order):
    """Without weights the criterion is that of the logarithm, up to the gain."""
    rng = np.random.default_rng(seed)
    magnitude = np.exp(np.interp(LEVEL, np.linspace(-5, 5, 6), rng.normal(size=6)))
    one, other = MagnitudeFit(OMEGA, magnitude, order), MagnitudeFit(OMEGA, 1 / magnitude, order)
    assert one.error(solve(one).answer) == pytest.approx(other.error(solve(other).answer), rel=1e-5)


def test_weights_share_the_error_out():
    weight = np.where(LEVEL < 0, 10.0, 1.0)
    program = MagnitudeFit(OMEGA, V, 3, weight=weight)
    solution = solve(program)
    assert solution.outcome is Outcome.SOLVED, solution.certificate
    relative = program.errors(solution.answer) / weight
    assert relative[LEVEL < 0].max() == pytest.approx(relative[LEVEL > 0].max() / 10, rel=1e-4)


def test_the_smallest_order_that_meets_an_error():
    assert fit_magnitude(OMEGA, V, error=0.05).nstates == 4
    assert fit_magnitude(OMEGA, np.full(OMEGA.size, 3.0), error=1e-6).nstates == 0
    with pytest.raises(SolverError, match=r"no order up to 4 .* the best reached is 0\.0"):
        fit_magnitude(OMEGA[::20], MADE["noise"][::20], error=1e-12)


def test_what_methods_claim():
    claims = {name: entry.optimal for name, entry in methods(MagnitudeFit).items()}
    assert claims["best"] and claims["minimax"]
    assert not (claims["sk"] or claims["sb10yd"] or claims["ipopt"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"omega": OMEGA[::-1]}, "omega must rise: sort it and merge what repeats; entry 1 "),
        ({"omega": np.append(OMEGA[:-1], OMEGA[-2])}, "merge what repeats; entry 199"),
        ({"omega": OMEGA - 1}, "omega must be positive and finite"),
        ({"omega": [[1.0]]}, "omega must have shape"),
        ({"omega": "fast"}, "omega must hold real numbers"),
        ({"magnitude": np.where(OMEGA > 50, 0.0, V)}, r"entry 85 is 0.0 \(at 51"),
        ({"magnitude": np.where(OMEGA > 50, np.nan, V)}, "entry 85 is nan"),
        ({"magnitude": V[:-1]}, r"magnitude has shape \(199,\), omega \(200,\)"),
        ({"magnitude": V + 0j}, "magnitude must hold real numbers"),
        ({"weight": 0 * V}, "weight must be positive"),
        ({"weight": []}, "weight has shape"),
        ({"order": -1}, "order must be a whole number"),
        ({"order": 2.0}, "order must be a whole number"),
        ({"order": 100}, "order 100 needs 202 data, there are 200: at most order 99"),
    ],
)
def test_bad_data_are_named(change, words):
    with pytest.raises(InputError, match=words):
        MagnitudeFit(**({"omega": OMEGA, "magnitude": V, "order": 2} | change))


@pytest.mark.parametrize("given", [{}, {"order": 1, "error": 0.1}, {"error": 0.0}])
def test_order_or_error_is_needed(given):
    with pytest.raises(InputError, match="error"):
        fit_magnitude(OMEGA, V, **given)


def test_datasets_come_back():
    program = MagnitudeFit(OMEGA, V, 3, cover=True)
    answer = solve(program, method="sb10yd").answer
    data = program.to_dataset(answer)
    assert data["omega"].attrs["units"] == "rad/s"
    back = program.from_dataset(data)
    assert program.metrics(back) == program.metrics(answer)


@pytest.mark.cases(1)
@pytest.mark.parametrize("cover", [False, True])
def test_figures_are_labelled(cover):
    program = MagnitudeFit(OMEGA, V, 2, cover=cover)
    figure = program.figures(solve(program).answer)["magnitude"]
    FigureCanvasAgg(figure).draw()
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "magnitude [1]",
        "weighted relative error [1]",
    ]
    assert figure.axes[-1].get_xlabel() == "frequency [Hz]"
