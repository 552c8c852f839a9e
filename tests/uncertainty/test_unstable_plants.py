"""Covers of plants with a pole right of the imaginary axis, as a magnetic bearing has."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.fitting import Rational
from workbench.identification import IdentificationWarning
from workbench.mu import conditions
from workbench.solution import solve
from workbench.synthesis import MuSynthesis
from workbench.uncertainty import CircleCover, Responses, StadiumCover, generalised_plant

OMEGA = np.geomspace(1.0, 1e4, 60)
SPREAD = np.random.default_rng(2).uniform(-1, 1, (2, 8))


def bearings() -> Responses:
    s = 1j * OMEGA[:, None]
    stiffness, gain = 100 * (1 + 0.05 * SPREAD[0]), 1 + 0.1 * SPREAD[1]
    return Responses(omega=OMEGA, values=gain * 1e4 / (s**2 - stiffness**2) / (1 + s / 3000))


@pytest.mark.cases(2)
@pytest.mark.parametrize("method", ["steps", "joint"])
@pytest.mark.parametrize("kind", [CircleCover, StadiumCover])
def test_the_nominal_has_the_plants_unstable_pole(kind, method):
    cover = solve(kind(bearings(), 3, zeros=0, complex_order=2, unstable_poles=1), method=method)
    assert cover.certificate.valid
    nominal = cover.answer.model.nominal
    assert nominal.poles[nominal.poles.real > 0] == pytest.approx([100], rel=0.05)
    stated = {check.name for check in cover.certificate.checks}
    assert {"nominal", "G grows"} <= stated


def test_a_stable_cover_of_unstable_plants_is_warned_of():
    s = 1j * OMEGA[:, None]
    responses = Responses(omega=OMEGA, values=(1 + 0.1 * SPREAD[1]) / (s - 100))
    with pytest.warns(IdentificationWarning, match="a pole right of the axis.*unstable_poles=1"):
        solve(CircleCover(responses, 1, zeros=0, complex_order=1), method="steps")


@pytest.mark.cases(0)
def test_a_controller_stabilises_every_bearing():
    bearing = bearings()
    cover = solve(CircleCover(bearing, 3, zeros=0, complex_order=2, unstable_poles=1))
    plant = generalised_plant(
        [cover, (1 / 3, "e", "z_e"), (0.01, "u", "z_u")],
        {"e": "r - f"},
        exogenous="r",
        control="u",
        performance=["z_e", "z_u"],
        measurement="e",
    )
    design = solve(MuSynthesis(plant), method="dk")
    assert design.certificate.valid and design.answer.upper < 1
    assert conditions(plant, design).robust_stability.upper < 1
    K = design.answer.K
    for stiffness, gain in zip(100 * (1 + 0.05 * SPREAD[0]), 1 + 0.1 * SPREAD[1], strict=True):
        given = Rational([], [stiffness, -stiffness, -3000.0], 3e7 * gain).state_space()
        assert (given.feedback(K).poles().real < 0).all()


def test_what_misfits_is_named():
    given = bearings()
    unstable = Rational([], [100.0, -100.0], 1e4)
    with pytest.raises(InputError, match="say unstable_poles=1 if every plant has as many"):
        CircleCover(given, 2, nominal=unstable)
    with pytest.raises(InputError, match="poles on the imaginary axis"):
        CircleCover(given, 2, nominal=Rational([], [0.0, -1.0], 1.0))
    with pytest.raises(InputError, match="unstable_poles is 4; the order is 3"):
        CircleCover(given, 3, unstable_poles=4)
    one = CircleCover(given, 2, nominal=unstable, unstable_poles=1)
    assert solve(one, method="joint").certificate.valid
