"""Searches with a plant of fewer states in place of a large one."""

import control
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import workbench as wb
from workbench.executor import Context
from workbench.synthesis import HinfSynthesis, MuSynthesis
from workbench.synthesis.mu.structured.norm.reduced_plant import reduced_plant
from workbench.synthesis.mu.structured.starts import search as searches
from workbench.synthesis.mu.structured.starts.found import found_starts
from workbench.systems.generalised_plant import GeneralisedPlant, response

STATES = 60
OMEGA = np.geomspace(1e-2, 1e3, 60)


def rod(weak=1.0, unstable=False):
    """Heat flow in a rod, heated and disturbed at one end and measured in the middle.

    Temperatures (z) and effort count. The disturbance is multiplied by `weak`; with `unstable` the
    whole rod also has a mode that grows.
    """
    n = STATES
    A = n * (np.diag(np.full(n, -2.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1))
    B, C = np.zeros((n, 2)), np.zeros((2, n))
    B[0] = weak, 1.0
    C[0, : n // 2], C[1, n // 4] = 1.0 / n, 1.0
    if unstable:
        A, B, C = (
            np.block([[A, np.zeros((n, 1))], [np.zeros((1, n)), 0.3]]),
            np.vstack([B, [[weak, 1.0]]]),
            np.hstack([C, [[0.1], [1.0]]]),
        )
    z = np.vstack([C[:1], 0 * C[:1], C[1:]])
    D = np.zeros((3, 3))
    D[1, 2], D[2, 1] = 0.5, 0.1  # effort, measurement noise
    inputs = np.column_stack([B[:, 0], 0 * B[:, 0], B[:, 1]])
    system = control.StateSpace(A, inputs, z, D, remove_useless_states=False)
    return GeneralisedPlant(system, None, 1, 1)


@pytest.mark.parametrize("weak", [1.0, 1e-9])
def test_every_channel_stays_even_a_weak_one(weak):
    plant = rod(weak)
    fewer = reduced_plant(plant)
    assert fewer.system.nstates <= 0.7 * STATES
    whole, part = response(plant.system, OMEGA), response(fewer.system, OMEGA)
    assert (np.abs(part - whole).max(axis=0) <= 1e-5 * np.abs(whole).max(axis=0)).all()


def test_poles_that_are_not_stable_stay():
    poles = reduced_plant(rod(unstable=True)).system.poles()
    assert poles.real.max() == pytest.approx(0.3, rel=1e-6)


def test_small_plants_and_plants_whose_states_all_count_stay():
    omega = np.arange(1.0, 21.0)
    A = np.kron(np.diag(omega), [[0.0, 1.0], [-1.0, -0.01]])
    B = np.kron(np.ones((20, 2)), [[0.0], [1.0]])
    modes = control.ss(A, B, np.kron(np.ones((2, 20)), [[1.0, 0.0]]), np.zeros((2, 2)))
    assert reduced_plant(GeneralisedPlant(modes, None, 1, 1)) is None
    small = control.ss(A[:20, :20], B[:20], np.eye(20)[:2], np.zeros((2, 2)))
    assert reduced_plant(GeneralisedPlant(small, None, 1, 1)) is None


@pytest.mark.cases(0)
def test_the_gain_found_is_the_best_one_for_the_large_plant():
    plant = rod(unstable=True)

    def norm(gain):
        loop = plant.system.lft(control.ss([], [], [], [[gain]]))
        if loop.poles().real.max() >= 0:
            return 1e6
        return control.linfnorm(loop, tol=1e-7)[0]

    best = minimize_scalar(norm, bounds=(-20.0, 0.0), method="bounded", options={"xatol": 1e-5})
    solution = wb.solve(HinfSynthesis(plant, order=0))
    assert solution.holds
    assert solution.answer.norm == pytest.approx(best.fun, rel=1e-3)


def test_starts_without_a_perturbation_wait_for_no_proof(monkeypatch):
    def refuse(*_):
        raise AssertionError("a proof was made")

    monkeypatch.setattr(searches, "stability_check", refuse)
    starts = found_starts(MuSynthesis(rod(), order=0), Context())
    assert starts and all(np.isfinite(one.peak) for one in starts)
