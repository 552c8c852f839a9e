"""Stored covers hold their drives between the given frequencies, by formulas and dense grids."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.plants import responses

FREQUENCY = np.geomspace(1.0, 20e3, 60_000)
OMEGA = 2 * np.pi * FREQUENCY
ROUNDING = 1e-9


def farthest(model, axis, gain="own"):
    """Largest distance of a drive from its set's segment over the radius; inside it is below 1."""
    G, W_c = model.nominal.response(OMEGA), model.W_c.response(OMEGA)
    away = responses(axis, FREQUENCY, gain, antialiasing=False) / G - 1
    if model.W_r is not None:
        end = model.W_r.response(OMEGA)
        along = (away * end.conj()).real / np.maximum(abs(end) ** 2, np.finfo(float).tiny)
        away = away - np.clip(along, -1.0, 1.0) * end
    return float((abs(away) / abs(W_c)).max())


COVERS = [("steps", "own"), ("steps", "equal"), ("steps", "agc"), ("joint", "own")]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("method", "gain"), COVERS)
@pytest.mark.parametrize("shape", ["circle", "stadium"])
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_no_drive_leaves_its_set_on_60000_frequencies(covered, axis, shape, method, gain):
    _, answer = covered(axis, shape, method, gain)
    distance = farthest(answer.model, axis, gain)
    assert 0.9 < distance <= 1.0 + ROUNDING  # a weight that needs this size, and no more than it


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_no_drive_leaves_the_set_for_which_the_fault_filter_is_certified(reference, axis):
    run = reference(f"cd/{axis}/cover-for-control")
    stages = run.answer.sizes["stage"]
    for number in range(stages):
        model, _ = run.task.stage(run.answer, number)
        assert farthest(model, axis) <= 1.0 + ROUNDING


def test_a_weight_a_thousandth_too_small_is_seen(covered):
    """The grid is dense enough to tell."""
    for shape in ("circle", "stadium"):
        _, answer = covered("focus", shape, "steps")
        model = answer.model
        smaller = type(model)(model.nominal, model.W_c.scaled(0.999), model.W_r)
        assert farthest(smaller, "focus") > 1.0005
