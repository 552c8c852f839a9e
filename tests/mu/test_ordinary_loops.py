"""Ordinary loops in every form, sampled or not, in any unit of time: margins in 50 digits."""

import warnings

import mpmath
import numpy as np
import pytest
from lanes import thinned
from ordinary_loops import DIGITS, FORMS, disagreements, loop_of, polynomials, truth

from workbench.errors import InputError
from workbench.mu import loop_margins
from workbench.mu.margins.classical import classical_margins

TOGETHER = 5
"""Loops in a test."""
GROUPS = thinned(range(1000), 25)
"""200 loops in `make test`, 5,000 in `make test-all`."""


def loops(group):
    seeds = range(TOGETHER * group, TOGETHER * (group + 1))
    with warnings.catch_warnings():  # SciPy and python-control judge coefficients by their size
        warnings.simplefilter("ignore")
        return {seed: loop_of(seed) for seed in seeds}


def formed(loop, form):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return loop.form(form)


@pytest.mark.cases(1)
@pytest.mark.parametrize("group", GROUPS)
def test_the_margins_of_every_form(group):
    for seed, loop in loops(group).items():
        for form in FORMS:
            L = formed(loop, form)
            found = classical_margins(L)
            told = disagreements(found, *polynomials(L), L.dt)
            assert not told, (seed, form, told)
            assert found.holds, (seed, form, found.certificate.failures)


def test_a_crossing_beside_a_pole_that_is_made_of_rounding():
    """The denominator is 4e-16 there, of terms up to 20: in doubles the response was 4e10."""
    L = formed(loop_of(2576), "zpk")
    found = classical_margins(L)
    assert len(found.phases_deg) == 2 and not disagreements(found, *polynomials(L), L.dt)


@pytest.mark.parametrize("group", GROUPS)
def test_all_margins_of_a_loop(group):
    """As a loop in one form, or of its plant and its controller."""
    for seed, loop in loops(group).items():
        form = (*FORMS, "pair")[seed % 7]
        if form == "pair":
            (N, D), (M, E) = polynomials(loop.P), polynomials(loop.C)
            given, numerator, denominator = (loop.P, loop.C), N * M, D * E
        else:
            given = (formed(loop, form),)
            numerator, denominator = polynomials(given[0])
        try:
            found = loop_margins(*given)
        except InputError as refused:
            assert "unstable at the nominal" in str(refused)
            exact = truth(numerator, denominator, loop.P.dt)
            doubtful = disagreements(Unstable(exact), numerator, denominator, loop.P.dt)
            assert not doubtful, (seed, form, str(refused))
            continue
        for name, margins in found.classical.items():
            told = disagreements(margins, numerator, denominator, loop.P.dt)
            assert not told, (seed, form, name, told)


class Unstable:
    """The truth, but for the verdict that the loop is unstable."""

    def __init__(self, exact):
        self.gains, self.phases_deg, self.delays = exact.gains, exact.phases_deg, exact.delays
        self.gain, self.phase_deg, self.delay = exact.gain, exact.phase_deg, exact.delay
        self.modulus, self.stable = 0.0, False


@pytest.mark.parametrize("group", GROUPS)
def test_between_gains_above_and_below_1_there_is_a_crossover(group):
    for seed, loop in loops(group).items():
        L = formed(loop, FORMS[seed % 6])
        N, D = polynomials(L)
        crossovers = classical_margins(L).phases_deg[:, 1]
        middle = crossovers.mean() if crossovers.size else 1.0 / (L.dt or 1.0)
        end = np.pi / L.dt if L.dt else np.inf
        omega = np.geomspace(1e-3, 1e3, 26) * middle  # not at a crossover
        omega = omega[omega < end]
        sizes = [gain_at(N, D, w, L.dt) for w in omega]
        for k in range(len(omega) - 1):
            if min(sizes[k : k + 2]) < 1 < max(sizes[k : k + 2]):
                inside = (omega[k] < crossovers) & (crossovers < omega[k + 1])
                assert inside.sum() % 2 == 1, (seed, omega[k : k + 2], crossovers)


def gain_at(N, D, omega, dt):
    with mpmath.workdps(DIGITS):
        s = mpmath.expj(mpmath.mpf(omega) * dt) if dt else mpmath.mpc(0, omega)
        above, below = (
            mpmath.polyval([mpmath.mpf(int(c.p)) / int(c.q) for c in p.coeffs()[::-1]], s)
            for p in (N, D)
        )
        return abs(above / below)


@pytest.mark.cases(1)
@pytest.mark.parametrize("group", GROUPS)
def test_a_change_of_the_unit_of_time_changes_nothing_else(group):
    """A power of two changes no bit of what is no time; another number rounds the coefficients."""
    for seed in range(TOGETHER * group, TOGETHER * (group + 1)):
        unit = 2.0 ** np.random.default_rng(seed).integers(-20, 21)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            here, there = loop_of(seed, 1.0), loop_of(seed, unit)
        if here.P.dt:  # python-control samples by matrices that round as they like
            continue
        for form in FORMS:
            one, other = (classical_margins(formed(loop, form)) for loop in (here, there))
            if form in ("tf", "product", "series"):
                assert one.stable == other.stable, (seed, form)
                assert other.gains[:, 0].tolist() == one.gains[:, 0].tolist(), (seed, form)
                assert other.phases_deg[:, 0].tolist() == one.phases_deg[:, 0].tolist(), (
                    seed,
                    form,
                )
                assert other.modulus == pytest.approx(one.modulus, rel=1e-12), (seed, form)
                assert (other.phases_deg[:, 1] * unit).tolist() == one.phases_deg[:, 1].tolist()
            else:
                L = formed(there, form)
                assert not disagreements(other, *polynomials(L), 0), (seed, form)
