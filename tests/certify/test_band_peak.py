"""Peaks over all frequencies that polynomials prove, against known ones."""

import control
import numpy as np
import pytest
from flint import ctx
from ill_conditioned import ill_conditioned, known_peak
from test_partial_fractions import (
    family,
    fractions_of,
    modal,
    nearly_unstable,
    response,
    tried,
)

from workbench.certify import norms
from workbench.certify.modes.band_peak import (
    _Intervals,
    _is_below,
    _positive,
    largest_singular_value,
    proven_peak,
)
from workbench.certify.modes.power_series import TERMS, polynomials
from workbench.certify.norms import NORM_TOLERANCE, certified_norm
from workbench.errors import InputError

S = control.tf("s")


def damped(zeta):
    return 1 / (S**2 + 2 * zeta * S + 1), 1 / (2 * zeta * np.sqrt(1 - zeta**2))


KNOWN = {
    "at zero": (1 / (S + 1), 1.0),
    "at infinity": (S / (S + 1), 1.0),
    "everywhere": ((1 - S) / (1 + S) * (S**2 - S + 100) / (S**2 + S + 100), 1.0),
    "a resonance": damped(0.1),
    "a sharp resonance": damped(1e-5),
    "fast and slow": (1e-6 * S / ((S + 1e-6) * (1e-6 * S + 1)), 1e-6 / (1 + 1e-12)),
    "a notch": ((S**2 + 1e-3 * S + 1) / (S**2 + S + 1), 1.0),
}


def parts_of(system):
    found = control.ss(system)
    return found.A, found.B, found.C, found.D


@pytest.mark.parametrize("case", KNOWN)
def test_known_peaks(case):
    system, peak = KNOWN[case]
    found = proven_peak(fractions_of(parts_of(system)), NORM_TOLERANCE)
    assert peak * (1 - 1e-12) <= found <= peak * (1 + 1.5 * NORM_TOLERANCE)


@pytest.mark.parametrize("case", KNOWN)
def test_claims_just_below_the_peak_are_not_proven(case):
    fractions = fractions_of(parts_of(KNOWN[case][0]))
    assert proven_peak(fractions, -1e-9) is None
    assert proven_peak(fractions, -1e-3) is None


@pytest.mark.parametrize("case", KNOWN)
def test_claims_just_above_the_peak_are_true_or_not_proven(case):
    system, peak = KNOWN[case]
    found = proven_peak(fractions_of(parts_of(system)), 1e-9)
    assert found is None or found >= peak * (1 - 1e-12)


@pytest.mark.parametrize("number", range(11))
def test_no_peak_lies_below_a_value(number):
    parts = list(family())[number]
    fractions = fractions_of(parts)
    found = proven_peak(fractions, NORM_TOLERANCE)
    if found is None:  # one next to the axis needs more than doubles
        assert number in {5, 8, 9}
        return
    omega = tried(fractions.poles, np.random.default_rng(3))
    A, B, C, D = parts
    values = [C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D for w in omega]
    largest = np.linalg.norm(values, 2, axis=(1, 2)).max()
    assert largest * (1 - 1e-9) <= found


@pytest.mark.parametrize("seed", range(40))
def test_ill_conditioned_systems(seed):
    case = ill_conditioned(seed)
    system = case.system
    fractions = fractions_of((system.A, system.B, system.C, system.D))
    found = fractions and proven_peak(fractions, NORM_TOLERANCE)
    if found is not None:
        truth = known_peak(case)
        assert truth <= found <= (1 + 2 * NORM_TOLERANCE) * truth


@pytest.mark.parametrize(("outputs", "inputs"), [(1, 1), (1, 4), (3, 2), (4, 4)])
def test_it_is_the_norm_by_intervals(outputs, inputs, monkeypatch):
    system = control.ss(*modal(7, outputs=outputs, inputs=inputs))
    found = norms._certified_norm(system)
    monkeypatch.setattr(norms, "_peak_of_fractions", lambda parts: None)
    assert found == pytest.approx(norms._certified_norm(system), rel=2 * NORM_TOLERANCE)


def test_norms_of_many_modes_take_no_eigenvalues_of_a_hamiltonian(monkeypatch):
    monkeypatch.setattr(norms, "_norm_by_intervals", None)
    for seed in range(3):
        assert certified_norm(control.ss(*modal(seed, pairs=20))) > 0.0
        parts = modal(10 + seed, pairs=20)
        sampled = control.sample_system(control.ss(*parts), 0.05, method="bilinear")
        assert certified_norm(sampled) == pytest.approx(
            certified_norm(control.ss(*parts)), rel=3 * NORM_TOLERANCE
        )


@pytest.mark.parametrize("distance", [1e-6, 1e-9, 1e-12])
def test_a_pole_next_to_the_axis(distance):
    A, B, C, D = nearly_unstable(distance)
    found = certified_norm(control.ss(A, B, C, D))
    with ctx.workprec(300):
        peak = np.linalg.norm([complex(x.mid()) for x in response((A, B, C, D), 1.0).entries()])
    assert peak * (1 - 1e-12) <= found <= peak * (1 + 3 * NORM_TOLERANCE)
    with pytest.raises(InputError, match="unstable"):
        certified_norm(control.ss(*nearly_unstable(-distance)))


def test_an_unstable_system_is_refused():
    A, B, C, D = modal(0)
    A = A + (1e-12 - np.linalg.eigvals(A).real.max()) * np.eye(len(A))
    with pytest.raises(InputError, match=r"unstable|cannot be told"):
        certified_norm(control.ss(A, B, C, D))


def test_zero_responses_have_none():
    A, B, C, D = modal(0)
    assert polynomials(fractions_of((A, 0 * B, C, 0 * D))) is None
    assert certified_norm(control.ss(A, 0 * B, C, 0 * D)) == 0.0


def test_positive_pivots_are_those_of_positive_definite_matrices():
    rng = np.random.default_rng(0)
    for p in range(1, 6):
        X = rng.normal(size=(200, p, p)) + 1j * rng.normal(size=(200, p, p))
        H = X @ X.conj().mT - rng.uniform(0, 1, 200)[:, None, None] * np.eye(p)
        least = np.linalg.eigvalsh(H)[:, 0]
        assert (np.abs(least) > 1e-10).all()
        assert (_positive(H) == (least > 0)).all()
    assert not _positive(np.full((1, 2, 2), np.nan, complex)).any()


def test_a_quadratic_is_below_where_it_is_everywhere():
    rng = np.random.default_rng(1)
    for p, q in ((1, 1), (1, 3), (2, 2), (3, 4)):
        g = [rng.normal(size=(100, q, p)) + 1j * rng.normal(size=(100, q, p)) for _ in range(3)]
        half = 0.25
        u = half * np.linspace(-1, 1, 41)[:, None, None, None]
        square = rng.uniform(0.3, 3, 100) * np.linalg.norm(g[0], 2, axis=(1, 2)) ** 2
        found = _is_below(square, tuple(g), half)
        assert 5 < found.sum() < 95
        g0, g1, g2 = g
        bend = g0.conj().mT @ g2 + g2.conj().mT @ g0 + g1.conj().mT @ g1
        form = g0.conj().mT @ g0 + u * (g0.conj().mT @ g1 + g1.conj().mT @ g0) + u**2 * bend
        largest = np.linalg.eigvalsh(form)[..., -1].max(axis=0)
        assert (largest[found] < square[found]).all()
        assert (found | (largest > 0.5 * square)).all()


@pytest.mark.cases(1)
@pytest.mark.parametrize("degree", [1, 2, 3, 16])
@pytest.mark.parametrize(("q", "p"), [(1, 1), (3, 2)])
def test_no_part_is_proven_below_its_largest_value(degree, q, p):
    rng = np.random.default_rng(degree)
    shape = (60, TERMS + 1, q, p)
    terms = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    terms[:, degree + 1 :] = 0.0
    terms[:20] /= 2.0 ** np.arange(TERMS + 1)[:, None, None]
    terms[20:40, 0] *= 3.0
    error = rng.uniform(0, 1, 60)
    g = _Intervals(terms, error)
    proven = 0
    for level in (1, 2, 3):
        count = 4**level
        cell, place = np.repeat(np.arange(60), count), np.tile(np.arange(count), 60)
        t = (2 * place + 1 - count)[:, None] / count + np.linspace(-1, 1, 21) / count
        values = np.einsum("snm,smqp->snqp", t[..., None] ** np.arange(TERMS + 1), terms[cell])
        largest = np.linalg.norm(values, 2, axis=(2, 3)).max(axis=1)
        expansion = g.expansion(cell, place, level)
        for share in (0.9, 0.99, 0.999999, 1.02, 1.5):
            for k in range(0, len(cell), 7):
                part = slice(k, k + 1)
                beta = share * largest[k] + error[cell[k]]
                few = tuple(one[part] for one in expansion)
                held = g.holds(beta, few, cell[part], place[part], level)[0]
                assert not (held and share < 1.0)
                proven += held
    assert proven > 100


def test_largest_singular_values():
    rng = np.random.default_rng(2)
    for shape in ((1, 1), (1, 3), (2, 2), (4, 2), (3, 3), (0, 2)):
        M = rng.normal(size=(5, *shape)) + 1j * rng.normal(size=(5, *shape))
        known = np.linalg.norm(M, 2, axis=(1, 2)) if 0 not in shape else np.zeros(5)
        assert largest_singular_value(M) == pytest.approx(known)
