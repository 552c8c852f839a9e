"""Ranges of stabilising gains: against eigenvalues and known ends, and where none stabilises."""

import control
import numpy as np
import pytest
from flint import fmpq_poly

from workbench.certify.proofs.static_gains import gain_ranges, is_hurwitz
from workbench.executor import Context
from workbench.solvers import Outcome
from workbench.synthesis.no_controller.no_gain import NoStabilisingGain

S = control.tf("s")


def stabilising(G):
    return [
        tuple(None if end is None else float(end) for end in (one.low, one.high))
        for one in gain_ranges(control.ss(G))
        if one.stabilises
    ]


@pytest.mark.parametrize(
    ("G", "expected"),
    [
        (1 / S, [(None, 0.0)]),
        (1 / (S - 1), [(None, -1.0)]),
        (1 / (S + 1) ** 3, [(-8.0, 1.0)]),
        ((S + 2) / (S - 1), [(None, -0.5), (1.0, None)]),  # through infinity
        (1 / ((S - 1) * (S + 3)), [(None, -3.0)]),
        (control.tf([2.0], [1.0]), [(None, 0.5), (0.5, None)]),
        (1 / S**2, []),
        (1 / ((S - 1) * (S - 3)), []),
        ((S - 1) / ((S - 2) * (S + 1)), []),
        (1 / (S**2 + 4), []),
    ],
)
def test_ranges_that_are_known(G, expected):
    found = stabilising(G)
    assert len(found) == len(expected)
    for (low, high), (a, b) in zip(found, expected, strict=True):
        for end, known in ((low, a), (high, b)):
            assert (end is None) == (known is None)
            assert end is None or end == pytest.approx(known, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("seed", range(60))
def test_ranges_are_those_of_eigenvalues(seed):
    rng = np.random.default_rng(seed)
    n, direct = int(rng.integers(1, 7)), float(rng.choice([0.0, 0.5]))
    A = rng.normal(size=(n, n)) - rng.uniform(0, 1.5) * np.eye(n)
    G = control.ss(A, rng.normal(size=(n, 1)), rng.normal(size=(1, n)), [[direct]])
    ranges = stabilising(G)
    for gain in np.concatenate([np.geomspace(1e-3, 1e3, 40), -np.geomspace(1e-3, 1e3, 40)]):
        closed = G.A + G.B @ G.C * (gain / (1 - gain * direct))
        abscissa = np.linalg.eigvals(closed).real.max()
        within = any((a is None or a <= gain) and (b is None or gain <= b) for a, b in ranges)
        assert within == (abscissa < 0) or abs(abscissa) < 1e-9


@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_units_of_time_do_not_matter(rate):
    lag = control.ss(-rate, rate, 1.0, 0.0)
    G = lag * lag * lag
    ((low, high),) = stabilising(G)
    assert (low, high) == pytest.approx((-8.0, 1.0), rel=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_routh_counts_as_roots_do(seed):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=3) - 0.5
    pair = rng.normal() - 0.5 + 1j * abs(rng.normal())
    coefficients = np.poly([*roots, pair, pair.conjugate()]).real * rng.choice([-1.0, 1.0])
    f = fmpq_poly([(int(c * 2**40)) for c in coefficients[::-1]])
    assert is_hurwitz(f) == (max(*roots, pair.real) < 0)


@pytest.mark.parametrize("coefficients", [[], [0, 1], [1, 0, 1], [1, 0, 2, 1], [2, 1, 2, 1]])
def test_routh_says_no_on_the_axis_and_without_a_coefficient(coefficients):
    assert not is_hurwitz(fmpq_poly(coefficients))


def test_the_claim_is_proven_and_a_spoilt_one_is_not():
    task = NoStabilisingGain(control.ss(1 / ((S - 1) * (S - 3))))
    answer, outcome, said = task.respond(None, Context())
    assert outcome is Outcome.SOLVED and "no constant gain" in said
    assert task.certify(answer, 1e-6).holds
    for gains in (answer["gains"] * 0.0 + 10.0, answer["gains"] + np.nan, answer["gains"][:1]):
        assert not task.certify(gains.to_dataset(name="gains"), 1e-6).holds
    other = NoStabilisingGain(control.ss(1 / (S - 1)))
    assert other.respond(None, Context())[1] is Outcome.FAILED
    certificate = other.certify(answer, 1e-6)
    assert next(c.name for c in certificate.checks if not c.holds) == "gains"


def test_eigenvalues_contradict_a_claim_that_is_wrong():
    task = NoStabilisingGain(control.ss(1 / (S - 1)))
    answer, _, _ = NoStabilisingGain(control.ss(1 / (S - 3) ** 2)).respond(None, Context())
    assert not all(check.holds for check in task.second_opinion(answer))
