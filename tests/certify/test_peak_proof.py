"""Proofs of peaks: stored, restored and proven again, and refused where something is missing."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

from workbench.certify.band_cover import CertifiedInterval
from workbench.certify.proofs import peak_proof
from workbench.certify.proofs.peak_proof import PeakProof, gaps, proves
from workbench.certify.proofs.storage import restored_proof, stored_proof
from workbench.certify.stable_system import stable_system
from workbench.mu.frequency.peak import peak
from workbench.structure import Complex, Full, Real, Structure

STRUCTURE = Structure([Real(2), Complex(1), Full(2, 2)])


@pytest.fixture(scope="module")
def system():
    rng = np.random.default_rng(0)
    A = np.kron(np.diag([0.3, 2.0, 60.0]), [[-0.01, 1.0], [-1.0, -0.01]])
    B, C = rng.normal(size=(6, 5)), rng.normal(size=(5, 6))
    return control.ss(A, B, C, 0.1 * rng.normal(size=(5, 5)))


@pytest.fixture(scope="module")
def found(system):
    return peak(system, STRUCTURE, tolerance=1e-4)


def test_a_stored_proof_proves_again(system, found, tmp_path):
    assert len(found.intervals) > 1
    xr.Dataset(stored_proof("peak", found.proof)).to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as data:
        proof = restored_proof(data, "peak")
    assert proves(system, STRUCTURE, proof, found.upper) == ""


@pytest.mark.cases(1)
@pytest.mark.parametrize("scale", [1.0, 0.9, 3.0])
@pytest.mark.parametrize("fast", [20.0, 1e3])
def test_linear_multipliers_prove_a_realisation_that_is_rounded_in_another_way(scale, fast):
    # mu of T R T^-1 is that of R at every frequency, but its multipliers follow T.
    lag = control.tf([1, 1], [1 / fast, 1])
    middle = control.ss([], [], [], [[1.0, 0.5], [-0.7, 0.3]])
    one = control.ss([], [], [], [[1.0]])
    ahead, after = (
        control.append(one, control.ss(lag / fast)),
        control.append(one, control.ss(fast / lag)),
    )
    flat = ahead * middle * after
    structure = Structure([Complex(1), Complex(1)])
    found = peak(control.ss(flat), structure, tolerance=1e-4)
    assert any(one.slopes is not None for one in found.intervals)
    A, B, C, D = control.ssdata(flat)
    T = np.diag(scale ** np.arange(len(A)))
    back = np.linalg.inv(T)
    other = control.ss(T @ A @ back, T @ B, C @ back, D)
    assert proves(other, structure, found.proof, found.upper) == ""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: replace(p, beta=0.98 * p.beta), "do not prove"),
        (lambda p: replace(p, beta=1.01 * p.beta), "above"),
        (lambda p: replace(p, intervals=_without(p, 0.0)), "no interval covers"),
        (lambda p: replace(p, intervals=_without(p, math.inf)), "no interval covers"),
        (lambda p: replace(p, intervals=()), "no interval covers"),
        (lambda p: PeakProof(p.beta, tuple(_negative(one) for one in p.intervals)), "do not prove"),
        (lambda p: PeakProof(p.beta, (_wide(p.intervals[0]),)), "do not prove"),
        (
            lambda p: PeakProof(p.beta / 2, tuple(_small(one) for one in p.intervals)),
            "do not prove",
        ),
    ],
)
def test_a_proof_that_is_none(system, found, change, words):
    assert words in proves(system, STRUCTURE, change(found.proof), found.upper)


def test_the_proof_is_one_of_its_system(system, found):
    larger = control.ss(system.A, system.B, 1.05 * system.C, 1.05 * system.D)
    assert "do not prove" in proves(larger, STRUCTURE, found.proof, found.upper)


def test_a_proof_with_slopes_is_read_back_as_it_was():
    rng = np.random.default_rng(1)
    parts = rng.normal(size=(6, 2, 2)) + 1j * rng.normal(size=(6, 2, 2))
    one = CertifiedInterval(1.0, 3.0, 2.0, *parts[:3], slopes=tuple(parts[3:]))
    fixed = CertifiedInterval(3.0, 4.0, 3.5, *parts[1:4])
    stored = xr.Dataset(stored_proof("peak", PeakProof(0.7, (one, fixed), (1.0, 4.0))))
    again = restored_proof(stored, "peak")
    assert (again.beta, again.band) == (0.7, (1.0, 4.0)) and again.intervals[1].slopes is None
    for old, new in zip((one, fixed), again.intervals, strict=True):
        assert (new.low, new.omega, new.high) == (old.low, old.omega, old.high)
        for omega in (new.low, new.omega, new.high):
            pairs = zip(old.multipliers(omega), new.multipliers(omega), strict=True)
            assert all((a == b).all() for a, b in pairs)


@pytest.mark.parametrize(("B", "C", "fault"), [(1.0, 1.0, True), (0.0, 1.0, False), (1, 0, False)])
def test_only_a_response_of_zero_needs_no_interval(B, C, fault):
    system = control.StateSpace([[-1.0]], [[B]], [[C]], [[0.0]], remove_useless_states=False)
    said = proves(system, Structure([Complex(1)]), PeakProof(0.5, ()), 0.5)
    assert bool(said) is fault


@pytest.mark.parametrize(
    ("intervals", "left"),
    [
        ([(0.0, 3.0), (3.0, 9.0)], []),
        ([(3.0, 9.0), (0.0, 3.0)], []),
        ([(0.0, 3.0), (3.001, 9.0)], [(3.0, 3.001)]),
        ([(0.0, 7.0), (1.0, 2.0), (6.0, 9.0)], []),
        ([(1.0, 8.0)], [(0.0, 1.0), (8.0, 9.0)]),
        ([(-2.0, -1.0), (10.0, 11.0)], [(0.0, 9.0)]),
        ([], [(0.0, 9.0)]),
    ],
)
def test_gaps_are_what_no_interval_covers(intervals, left):
    assert gaps(intervals, (0.0, 9.0)) == left


@pytest.mark.parametrize("far", [[], [(0.0, 1.0)], [(3.0, 4.0)]])
def test_a_band_of_one_frequency_may_be_a_gap(far):
    assert gaps(far, (2.0, 2.0)) == [(2.0, 2.0)]
    assert gaps([*far, (1.0, 2.0)], (2.0, 2.0)) == []


def test_what_is_left_after_the_last_piece_is_not_proven(system, found, monkeypatch):
    monkeypatch.setattr(peak_proof, "PIECES", 0)
    wide = tuple(replace(one, low=0.0, high=math.inf) for one in found.intervals[:1])
    assert proves(system, STRUCTURE, PeakProof(found.upper, wide), found.upper)


def _small(interval):
    """Multipliers that differ on both sides: as they are, the right ones would prove any bound."""
    return replace(interval, D_right=interval.D_right * 1e8)


def _without(proof, omega):
    return tuple(one for one in proof.intervals if not one.low <= omega <= one.high)


def _negative(interval):
    return replace(interval, D_left=-interval.D_left, D_right=-interval.D_right)


def _wide(interval):
    return replace(interval, low=0.0, high=math.inf)


def test_multipliers_that_prove_their_interval_and_nothing_beyond_are_enough(monkeypatch):
    lag = stable_system(control.ss(-1.0, 1.0, 1.0, 0.0))
    one, slope, zero = np.eye(1), 0.01 * np.eye(1), np.zeros((1, 1))
    interval = CertifiedInterval(9.0, 11.0, 10.0, one, one, zero, (slope, slope, zero))
    whole = peak_proof.proven_in_doubles

    def up_to_the_ends(system, multipliers, beta, omega, slopes, half, end_margin):
        if half > 1.05:
            return None, False
        return whole(system, multipliers, beta, omega, slopes, half, end_margin)

    monkeypatch.setattr(peak_proof, "proven_in_doubles", up_to_the_ends)
    ends = peak_proof._ends(lag, Structure([Complex(1)]), interval, 1.001)
    assert ends is not None and ends[0] <= 9.0 and ends[1] >= 11.0


def test_linear_multipliers_that_rounding_hides_prove_their_interval_held_fixed(monkeypatch):
    """As on a processor whose pencil of eigenvalues has larger discs about this interval."""
    fast = 1e3
    lag = control.tf([1, 1], [1 / fast, 1])
    middle = control.ss([], [], [], [[1.0, 0.5], [-0.7, 0.3]])
    one = control.ss([], [], [], [[1.0]])
    ahead, after = control.append(one, lag / fast), control.append(one, fast / lag)
    flat = control.ss(ahead * middle * after)
    structure = Structure([Complex(1), Complex(1)])
    found = peak(flat, structure, tolerance=1e-2)
    linear = [one for one in found.proof.intervals if one.slopes is not None]
    hidden = max(linear, key=lambda one: one.omega)
    in_doubles, certified = peak_proof.proven_in_doubles, peak_proof.certified_interval

    def is_hidden(omega, slopes):
        return slopes is not None and hidden.low <= omega <= hidden.high

    def doubles(system, multipliers, beta, omega, slopes=None, *rest, **settings):
        if is_hidden(omega, slopes):
            return None, True
        return in_doubles(system, multipliers, beta, omega, slopes, *rest, **settings)

    def interval(system, left, right, G, beta, omega, slopes=None, *rest, **settings):
        if is_hidden(omega, slopes):
            return None
        return certified(system, left, right, G, beta, omega, slopes, *rest, **settings)

    monkeypatch.setattr(peak_proof, "proven_in_doubles", doubles)
    monkeypatch.setattr(peak_proof, "certified_interval", interval)
    assert proves(flat, structure, found.proof, found.upper) == ""
