"""Covers of known plants: they hold at every frequency, and certificates say over what."""

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.uncertainty import (
    CircleCover,
    CoverSteps,
    Parameter,
    Responses,
    StadiumCover,
    block_matrix,
    members,
    parametric_lft,
    vertex_deltas,
    widened_responses,
)

OMEGA = np.geomspace(1, 1000, 14)
BETWEEN = float(np.sqrt(OMEGA[8] * OMEGA[9]))
DENSE = np.unique(
    np.concatenate([np.geomspace(0.01, 1e5, 20001), BETWEEN + np.linspace(-1, 1, 201)])
)


def plant(level, damping, gain, light=0.0, height=0.0):
    """A resonance of 30 rad/s, and a light one between the frequencies where height is not 0."""
    system = control.tf([gain * 900 * level**2], [1, 60 * damping * level, 900 * level**2])
    if height:
        resonance = control.tf(
            [1, 2 * height * BETWEEN, BETWEEN**2], [1, 2 * light * BETWEEN, BETWEEN**2]
        )
        system = system * resonance
    return control.ss(system)


def family(light=0.02, height=0.03):
    rng = np.random.default_rng(1)
    draws = 1 + 0.15 * rng.uniform(-1, 1, (5, 3))
    plants = [plant(level, 0.1 * d, g) for level, d, g in draws]
    return [*plants, plant(1.0, 0.1, 1.0, light, height)]


def responses(systems, known=True):
    values = np.array([system(1j * OMEGA) for system in systems]).T
    return Responses(omega=OMEGA, values=values, known=systems if known else None)


def program(kind, data, **more):
    orders = {"order": 2, "zeros": 0, "complex_order": 2} | more
    return (
        StadiumCover(data, real_order=1, **orders)
        if kind == "stadium"
        else CircleCover(data, **orders)
    )


@cache
def covered(kind, known, light=0.02, height=0.03):
    task = program(kind, responses(family(light, height), known))
    return task, wb.solve(task, method="steps")


def by_name(certificate):
    return {check.name: check for check in certificate.checks}


def excess(model, systems):
    """The largest excess on a dense grid, by formulas."""
    g, W_c = (f.response(DENSE) for f in (model.nominal, model.W_c))
    end = model.W_r.response(DENSE) if model.W_r else np.zeros_like(g)
    values = np.array([system(1j * DENSE) for system in systems]).T
    away = values / g[:, None] - 1
    along = np.clip((away / np.where(end == 0, 1, end)[:, None]).real, -1, 1)
    return (np.abs(away - along * end[:, None]) / np.abs(W_c)[:, None]).max() - 1


@pytest.mark.cases(0)
@pytest.mark.parametrize("kind", [pytest.param("circle", marks=pytest.mark.slow), "stadium"])
def test_known_plants_are_contained_between_the_frequencies(kind):
    systems = family()
    _, measured = covered(kind, False)
    assert measured.certificate.valid
    assert excess(measured.answer.model, systems) > 0.01
    task, known = covered(kind, True)
    assert known.certificate.failures == ()
    assert excess(known.answer.model, systems) <= 1e-9
    checks = by_name(known.certificate)
    assert checks["containment everywhere"].over == "at every frequency, for these 6 plants"
    assert checks["containment"].over == "at the 14 given frequencies, for these 6 plants"
    assert checks["support between"].opinion
    assert "containment everywhere" not in by_name(measured.certificate)
    assert all("every frequency" not in check.over for check in measured.certificate.checks)
    assert "at every frequency, for these 6 plants" in repr(known.certificate)
    stored = wb.Certificate.from_json(known.certificate.to_json())
    assert stored == known.certificate
    back = task.from_dataset(task.to_dataset(known.answer))
    assert task.certify(back, 1e-6).valid


@pytest.mark.slow
def test_resonance_of_damping_1e_6_is_contained():
    """1e5 times as high as the set at the frequencies beside it: the weight has to reach it."""
    systems = family(1e-6, 1e-2)
    _, found = covered("circle", True, 1e-6, 1e-2)
    assert found.certificate.failures == ()
    assert abs(found.answer.model.W_c.response([BETWEEN])[0]) > 0.9 * 1e-2 / 1e-6 / 2
    assert excess(found.answer.model, systems) <= 1e-9


def test_smaller_weight_is_refused_and_the_place_is_named():
    task, found = covered("circle", True)
    model = found.answer.model
    smaller = replace(model, W_c=model.W_c.scaled(0.98))
    steps = found.answer
    answer = CoverSteps(smaller, steps.first, steps.second, steps.third)
    certificate = task.certify(answer, 1e-6)
    check = by_name(certificate)["containment everywhere"]
    assert not check.holds
    assert check.value == pytest.approx(1 / 0.98 - 1, rel=1e-3)
    assert "Hz, by " in check.where


def test_equal_plants_are_covered():
    one = plant(1.0, 0.1, 1.0)
    found = wb.solve(program("circle", responses([one, one])), method="steps")
    assert found.certificate.failures == ()


def test_additive_weights_cover_everywhere():
    task = program("circle", responses(family()), form="additive")
    assert wb.solve(task, method="steps").certificate.failures == ()


def test_plants_that_are_only_measured_count_at_their_frequencies():
    systems = family()
    data = responses(systems, False)
    mixed = replace(data, known=[*systems[:3], None, None, None])
    task = program("circle", mixed)
    found = wb.solve(task, method="steps")
    assert found.certificate.failures == ()
    checks = by_name(found.certificate)
    assert checks["containment everywhere"].over == "at every frequency, for these 3 plants"
    wide = widened_responses(mixed, 0.9)
    assert len(wide.known_plants) == 3
    assert wb.solve(program("circle", wide), method="steps").certificate.failures == ()


def test_points_left_out_leave_the_claim_at_the_frequencies():
    task = program("circle", responses(family()), leave_out=1)
    certificate = wb.solve(task, method="steps").certificate
    assert certificate.valid
    assert "containment everywhere" not in by_name(certificate)


def test_members_of_a_parametric_set_are_known():
    """The claim names how many they are: of the other plants of the set nothing is said."""

    def oscillator(k, b):
        return block_matrix([[0.0, 1.0], [-k, -b]]), np.eye(2, 1, k=-1), np.eye(1, 2), 0.0

    box = [Parameter("k", 900.0, 0.2), Parameter("b", 6.0, 0.3)]
    model = parametric_lft(oscillator, box, inputs=["u"], outputs=["y"])
    data = members(model, OMEGA, vertex_deltas(box))
    certificate = wb.solve(program("stadium", data), method="steps").certificate
    assert certificate.failures == ()
    check = by_name(certificate)["containment everywhere"]
    assert check.over == "at every frequency, for these 4 plants"


def test_relative_deviation_without_bound_is_said():
    """A nominal that falls faster than the plants: their relative deviation grows for ever."""
    flat = [control.tf([g, g], [1, 2]) for g in (0.9, 1.0, 1.1)]
    values = np.array([system(1j * OMEGA) for system in flat]).T
    task = program("circle", Responses(omega=OMEGA, values=values, known=flat), order=2, zeros=0)
    found = wb.solve(task, method="steps")
    assert found.certificate is None
    assert "is unbounded" in found.message


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ([Rational([], [-1.0], 1.0)], "1 known systems for 2 plants"),
        ([Rational([], [-1.0], 1.0), Rational([], [1.0], -1.0)], "plant 2 is unstable"),
        ([Rational([], [-1.0], 1.0), Rational([], [-1.0], 1.1)], "plant 2 has another response"),
        ([Rational([], [-1.0], 1.0), "G"], "a transfer function or state space is needed"),
    ],
)
def test_known_plants_that_cannot_be_are_refused(known, words):
    values = np.tile((1 / (1j * OMEGA + 1))[:, None], 2)
    with pytest.raises(InputError, match=words):
        Responses(omega=OMEGA, values=values, known=known)


def test_grids_of_known_plants_are_refined_between_the_frequencies():
    data = responses(family())
    fine = data.refined()
    assert set(data.omega) <= set(fine.omega)
    assert np.abs(fine.omega - BETWEEN).min() < 0.02 * BETWEEN
    assert fine.omega[[0, -1]].tolist() == data.omega[[0, -1]].tolist()
    np.testing.assert_array_equal(fine.values[np.searchsorted(fine.omega, OMEGA)], data.values)
    measured = responses(family(), False)
    assert measured.refined() is measured
    mixed = replace(data, known=[*data.known[:5], None])
    assert mixed.refined() is mixed


@pytest.mark.slow
def test_a_joint_search_on_few_frequencies_sees_what_lies_between():
    """The drives at 40 frequencies, 19 % apart; their resonances are 3 % wide."""
    from workbench.plants.cd_drive.uncertainty.stadium_cover import stadium_cover

    dense, sizes = stadium_cover("focus", frequencies=1000).refined(), {}
    for frequencies in (40, 200):
        answer = wb.solve(stadium_cover("focus", frequencies=frequencies), method="joint").answer
        sizes[frequencies] = np.sqrt(dense.objective(answer))
    assert sizes[40] < 1.5 * sizes[200]
