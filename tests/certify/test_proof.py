"""Proofs of peaks: stored, restored and proven again, and refused where something is missing."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

from workbench.certify.proofs.peak_proof import PeakProof, proves
from workbench.certify.proofs.storage import restored_proof, stored_proof
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
    return peak(system, STRUCTURE, 1e-4)


def test_a_stored_proof_proves_again(system, found, tmp_path):
    assert len(found.intervals) > 1
    xr.Dataset(stored_proof("peak", found.proof)).to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as data:
        proof = restored_proof(data, "peak")
    assert proves(system, STRUCTURE, proof, found.upper) == ""


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
    found = peak(control.ss(flat), structure, 1e-4)
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
    ],
)
def test_a_proof_that_is_none(system, found, change, words):
    assert words in proves(system, STRUCTURE, change(found.proof), found.upper)


def test_the_proof_is_one_of_its_system(system, found):
    larger = control.ss(system.A, system.B, 1.05 * system.C, 1.05 * system.D)
    assert "do not prove" in proves(larger, STRUCTURE, found.proof, found.upper)


def _without(proof, omega):
    return tuple(one for one in proof.intervals if not one.low <= omega <= one.high)


def _negative(interval):
    return replace(interval, D_left=-interval.D_left, D_right=-interval.D_right)


def _wide(interval):
    return replace(interval, low=0.0, high=math.inf)
