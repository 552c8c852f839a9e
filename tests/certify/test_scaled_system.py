"""Bounds of mu proven by scalings that are functions of frequency."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

from workbench.certify.proofs.peak_proof import PeakProof, proves
from workbench.certify.proofs.scaled_system import (
    ScalingFunctions,
    scaled_interval,
    scaled_system,
)
from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.stable_system import stable_system
from workbench.mu.frequency.scaled_peak import scaled_peak
from workbench.structure import Complex, Full, Structure

STRUCTURE = Structure([Complex(2), Full(1, 2), Full(2, 1)])
OMEGA = [0.0, 1e-3, 0.3, 1.0, 7.0, 1e3, math.inf]


@pytest.fixture(scope="module")
def system():
    rng = np.random.default_rng(0)
    A = np.kron(np.diag([0.3, 2.0, 60.0]), [[-0.05, 1.0], [-1.0, -0.05]])
    r, c = STRUCTURE.rows, STRUCTURE.columns
    B, C, D = rng.normal(size=(6, r)), rng.normal(size=(c, 6)), 0.1 * rng.normal(size=(c, r))
    return control.ss(A, B, C, D)


@pytest.fixture(scope="module")
def scalings():
    """Of the first two blocks, each with two quadratic factors."""
    factors = np.random.default_rng(1).uniform(0.5, 2.0, (2, 2, 2, 2))
    return ScalingFunctions(np.array([0.7, 1.9]), factors[0], factors[1])


def scaled_response(system, scalings, omega):
    """D M D^-1 at a frequency, with D from the polynomials; that at infinity is at a high one."""
    s = 1j * min(omega, 1e9)
    above, below = (
        (s**2 + part[..., 0] * s + part[..., 1]).prod(axis=1)
        for part in (scalings.numerators, scalings.denominators)
    )
    d = np.append(scalings.gain * above / below, 1.0)
    left = np.repeat(d, [block.columns for block in STRUCTURE])
    right = np.repeat(d, [block.rows for block in STRUCTURE])
    return left[:, None] * system(s) / right


def test_the_scaled_system_encloses_D_M_over_D(system, scalings):
    scaled = scaled_system(stable_system(system), STRUCTURE, scalings)
    for omega in OMEGA:
        expected = scaled_response(system, scalings, omega)
        np.testing.assert_allclose(scaled.response(omega)[0], expected, rtol=1e-6, atol=1e-9)
    assert all(0 < error.max() < 1e-12 for error in scaled.errors[1:])


def test_multipliers_are_squares_of_the_magnitudes(scalings):
    for omega in OMEGA:
        D_left, D_right, G = scalings.multipliers(STRUCTURE, omega)
        d = np.append(scalings.magnitudes(omega) ** 2, 1.0)
        np.testing.assert_allclose(np.diag(D_left), d[[0, 0, 1, 1, 2]])
        np.testing.assert_allclose(np.diag(D_right), d[[0, 0, 1, 2, 2]])
        assert not G.any()


@pytest.mark.cases(0)
def test_the_bound_is_the_norm_of_the_scaled_system(system, scalings):
    """Just above the norm all frequencies are proven, below it the peak is left out."""
    grid = np.geomspace(0.01, 1e3, 20000)
    size = [np.linalg.norm(scaled_response(system, scalings, w), 2) for w in grid]
    norm, peak = max(size), grid[np.argmax(size)]
    stable = stable_system(system)
    assert scaled_interval(stable, STRUCTURE, scalings, 1.001 * norm) == (0.0, math.inf)
    ends = scaled_interval(stable, STRUCTURE, scalings, 0.99 * norm)
    assert ends is None or not ends[0] <= peak <= ends[1]


@pytest.fixture(scope="module")
def proof(system, scalings):
    norm = float(control.linfnorm(_realised(system, scalings))[0])
    return PeakProof(1.001 * norm, (), scalings=scalings)


def _realised(system, scalings):
    scaled = scaled_system(stable_system(system), STRUCTURE, scalings)
    return control.ss(scaled.A, scaled.B, scaled.C, scaled.D)


def test_a_stored_proof_proves_again(system, proof, tmp_path):
    xr.Dataset(stored_proof("peak", proof)).to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as data:
        again = restored_proof(data, "peak")
    assert again.scalings is not None
    assert proves(system, STRUCTURE, again, proof.beta) == ""


def spoilt(**changes):
    def change(proof):
        scalings = proof.scalings
        return replace(
            proof,
            scalings=replace(scalings, **{k: f(getattr(scalings, k)) for k, f in changes.items()}),
        )

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: replace(p, beta=0.98 * p.beta), "no interval covers"),
        (lambda p: replace(p, beta=1.01 * p.beta), "above"),
        (lambda p: replace(p, scalings=None), "no interval covers"),
        (spoilt(gain=lambda g: 3.0 * g), "no interval covers"),
        (spoilt(gain=lambda g: -g), "not stable functions"),
        (spoilt(gain=lambda g: g * np.nan), "not stable functions"),
        (spoilt(numerators=lambda n: -n), "not stable functions"),
        (spoilt(denominators=lambda m: 0.0 * m), "not stable functions"),
        (spoilt(denominators=lambda m: m[:, :1]), "shapes"),
        (spoilt(numerators=lambda n: n.ravel()), "shapes"),
        (spoilt(gain=lambda g: g[:1]), "shapes"),
        (
            spoilt(
                gain=lambda g: np.tile(g, 2),
                numerators=lambda n: np.tile(n, (2, 1, 1)),
                denominators=lambda m: np.tile(m, (2, 1, 1)),
            ),
            "shapes",
        ),
    ],
)
def test_a_proof_that_is_none(system, proof, change, words):
    assert words in proves(system, STRUCTURE, change(proof), proof.beta)


def test_the_proof_is_one_of_its_system(system, proof):
    larger = control.ss(system.A, system.B, 1.05 * system.C, 1.05 * system.D)
    assert "no interval" in proves(larger, STRUCTURE, proof, proof.beta)


def test_a_peak_by_scalings(system, proof):
    found = scaled_peak(system, STRUCTURE, proof.scalings, proof.beta)
    assert 0 < found.lower <= found.upper == proof.beta
    assert proves(system, STRUCTURE, found.proof, found.upper) == ""
    D_left, D_right, _ = found.multipliers(STRUCTURE)
    M = system(1j * found.omega)
    bound = np.linalg.norm(np.sqrt(D_left) @ M / np.sqrt(np.diag(D_right)), 2)
    assert found.lower <= bound <= found.upper
    assert scaled_peak(system, STRUCTURE, proof.scalings, 0.9 * found.lower) is None


def test_intervals_cover_what_scalings_leave_open(system, proof):
    """A proof by both: scalings on their interval, multipliers on the rest."""
    from workbench.mu.frequency.peak import peak

    whole = peak(system, STRUCTURE, tolerance=1e-2)
    assert whole.upper < 0.99 * proof.beta  # these scalings are not the best ones
    ends = scaled_interval(stable_system(system), STRUCTURE, proof.scalings, whole.upper)
    inside = (
        []
        if ends is None
        else [one for one in whole.intervals if one.low > ends[0] and one.high < ends[1]]
    )
    both = PeakProof(
        whole.upper,
        tuple(one for one in whole.intervals if one not in inside),
        scalings=proof.scalings,
    )
    assert proves(system, STRUCTURE, both, whole.upper) == ""
