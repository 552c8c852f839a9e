"""Proofs of peaks: stored, restored and proven again, and refused where something is missing."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

from workbench.certify.proof import PeakProof, proves
from workbench.certify.proof_storage import restored_proof, stored_proof
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


def test_linear_multipliers_prove_again():
    rng = np.random.default_rng(1)
    A = np.kron(np.diag(np.geomspace(0.1, 30, 6)), [[-0.3, 1.0], [-1.0, -0.3]])
    B, C = rng.normal(size=(12, 3)), rng.normal(size=(3, 12))
    system = control.ss(A, B, C, np.eye(3))
    structure = Structure([Complex(1), Complex(1), Complex(1)])
    found = peak(system, structure, 1e-6)
    assert proves(system, structure, found.proof, found.upper) == ""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: replace(p, beta=0.98 * p.beta), "do not prove"),
        (lambda p: replace(p, beta=1.01 * p.beta), "above"),
        (lambda p: replace(p, intervals=_without(p, 0.0)), "no interval covers"),
        (lambda p: replace(p, intervals=_without(p, math.inf)), "no interval covers"),
        (lambda p: replace(p, intervals=()), "no interval covers"),
        (lambda p: PeakProof(p.beta, tuple(_negative(one) for one in p.intervals)), "do not prove"),
        (lambda p: PeakProof(p.beta, tuple(_wide(one) for one in p.intervals)), "do not prove"),
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
