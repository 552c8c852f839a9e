"""The control problems against the closed formulas of eq. 6.7-6.10, signs corrected."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.control.control_problem import (
    control_weight,
    generalised,
    optical_gain,
    performance_weight,
)
from workbench.plants.cd_drive.drive.plants import ANTIALIASING, controller, loop_response, plant
from workbench.plants.cd_drive.drive.tables import ActuatorParameters, nominal_table
from workbench.plants.cd_drive.uncertainty.parametric_model import (
    parametric_nominal,
    parametric_plant,
    uncertain_parameters,
)

from workbench.errors import InputError
from workbench.structure import Complex, Full, Real, Structure
from workbench.systems.generalised_plant import response
from workbench.uncertainty import UncertaintyModel

FREQUENCY = np.geomspace(2.0, 20e3, 60)
OMEGA = 2 * np.pi * FREQUENCY
S = 1j * OMEGA
W_R = control.zpk([-2e3, 4e4], [-8e3, -1e4], 0.3)
W_C = control.zpk([-1e3, -2e3 + 3e3j, -2e3 - 3e3j], [-5e4, -1e3 + 2e3j, -1e3 - 2e3j], 0.5)
AXES = ["focus", "radial"]
ONES = np.ones((len(S), 1, 2))


def zpk(system):
    """Response from roots: no realisation."""
    zeros, poles = system.zeros(), system.poles()
    gain = system.num[0][0][0] / system.den[0][0][0]
    return gain * np.prod(S[:, None] - zeros, axis=1) / np.prod(S[:, None] - poles, axis=1)


def loop(axis):
    """K, H = K_optn AAF, ACT and S = 1 / (1 + ACT K H), by the drives' own equations."""
    k = zpk(controller(axis))
    h = optical_gain(axis) / (1 + S / ANTIALIASING)
    open_loop = loop_response(axis, FREQUENCY)
    return k, h, open_loop / (k * h), 1 / (1 + open_loop)


def performance(axis, speed=1.0):
    """Eq. 6.11."""
    if axis == "focus":
        M, A, w_B, w_I = 2.0, 0.004, 2 * np.pi * 230, 2 * np.pi * 10
    else:
        M, A, w_B, w_I = 2.0, 0.2 / 70, 2 * np.pi * 145, 2 * np.pi * 5
    w_B *= speed
    corner = (S / M ** (1 / 3) + w_B) / (S + w_B * A ** (1 / 3))
    return corner**3 * (S + w_I) / (S + 0.001)


def rows(*entries):
    return np.stack(entries, axis=-1)[..., None] @ ONES


def mixed(axis, W_r=W_R, form="multiplicative"):
    return UncertaintyModel(parametric_nominal(axis), W_C, W_r, form=form)


@pytest.mark.parametrize("axis", AXES)
def test_the_closed_loop_matches_its_formulas(axis):
    problem = generalised(axis, mixed(axis))
    assert problem.structure == Structure([Real(1, name="real"), Complex(1, name="complex")])
    assert problem.structure.with_performance(2, 2).blocks[-1] == Full(2, 2, name="performance")
    assert problem.system.input_labels == ["u_r", "u_c", "w_p", "w_u", "u"]
    assert problem.system.output_labels == ["y_r", "y_c", "z_p", "z_u", "f_en"]
    N = problem.close(controller(axis))
    assert N.poles().real.max() < 0

    k, h, act, s = loop(axis)
    w_p, w_u, w_r, w_c = performance(axis), 0.01 / optical_gain(axis), zpk(W_R), zpk(W_C)
    ksh = k * s * h
    expected = (
        rows(-w_r * ksh * act, -w_c * ksh * act),
        rows(w_r * ksh, w_c * ksh),
        rows(w_p * act * (ksh * act - 1), -w_u * ksh * act),
        rows(w_p * (1 - act * ksh), w_u * ksh),
    )
    found = problem.partition(response(N, OMEGA))
    for block, formula in zip(found, expected, strict=True):
        np.testing.assert_allclose(block, formula, rtol=1e-8)

    # As printed, N12 (eq. 6.8) and the second row of N22 (eq. 6.10) have the other sign.
    for block, printed in (
        (found[1], rows(-w_r * ksh, -w_c * ksh)),
        (found[3][:, 1:], rows(-w_u * ksh)),
    ):
        assert (abs(block / printed - 1) > 1.9).all()


@pytest.mark.parametrize(
    ("axis", "channel", "both"), [("focus", 0.732, 1.136), ("radial", 0.879, 1.243)]
)
def test_nominal_performance(axis, channel, both):
    """From w_p to z_p below 1; with a full block on both channels, whose inputs add up, not."""
    problem = generalised(axis, mixed(axis))
    dense = 2 * np.pi * np.geomspace(0.01, 20e3, 2000)
    N22 = problem.partition(response(problem.close(controller(axis)), dense))[3]
    assert abs(N22[:, 0, 0]).max() == pytest.approx(channel, abs=2e-3)
    assert np.linalg.norm(N22, 2, axis=(1, 2)).max() == pytest.approx(both, abs=2e-3)


@pytest.mark.parametrize("axis", AXES)
def test_circles_have_the_complex_block_alone(axis):
    problem = generalised(axis, mixed(axis, None))
    N = problem.close(controller(axis))
    assert problem.structure == Structure([Complex(1, name="complex")])
    assert problem.system.input_labels == ["u_c", "w_p", "w_u", "u"]
    k, h, act, s = loop(axis)
    expected = -zpk(W_C) * k * s * h * act
    np.testing.assert_allclose(response(N, OMEGA)[:, 0, 0], expected, rtol=1e-8)


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
@pytest.mark.parametrize("axis", AXES)
def test_delta_perturbs_the_plant_as_the_model_says(axis, form):
    problem = generalised(axis, mixed(axis, form=form))
    N11, N12, N21, N22 = problem.partition(response(problem.close(controller(axis)), OMEGA))
    k, h, act, _ = loop(axis)
    Delta = np.diag([-0.7, 0.4 + 0.5j])
    away = zpk(W_R) * Delta[0, 0] + zpk(W_C) * Delta[1, 1]
    perturbed = act * (1 + away) if form == "multiplicative" else act + away / optical_gain(axis)
    closed = N22 + N21 @ np.linalg.solve(np.eye(2) - Delta @ N11, Delta @ N12)
    compare(axis, closed, 1 / (1 + perturbed * k * h))


@pytest.mark.parametrize("axis", AXES)
def test_deltas_of_the_parameters_perturb_the_plant(axis):
    problem = generalised(axis, parametric_plant(axis))
    assert problem.structure == Structure(
        [Real(1, name="R"), Real(1, name="k1"), Real(1, name="k2")]
    )
    N11, N12, N21, N22 = problem.partition(response(problem.close(controller(axis)), OMEGA))
    table = {name: entry.nominal for name, entry in nominal_table(axis).items()}
    for delta in np.random.default_rng(3).uniform(-1, 1, (4, 3)):
        changed = zip(uncertain_parameters(axis), delta, strict=True)
        values = table | {p.name: float(p.at(d)) for p, d in changed}
        K_total = values.pop("K_total")
        one = response(plant(ActuatorParameters(**values), K_total), OMEGA)[:, 0, 0]
        Delta = np.diag(delta)
        closed = N22 + N21 @ np.linalg.solve(np.eye(3) - Delta @ N11, Delta @ N12)
        compare(axis, closed, 1 / (1 + one * zpk(controller(axis))))


def compare(axis, closed, sensitivity):
    """N with Delta closed against S of the perturbed loop."""
    k, h, _, _ = loop(axis)
    expected = rows(
        performance(axis) * sensitivity, 0.01 / optical_gain(axis) * k * sensitivity * h
    )
    np.testing.assert_allclose(closed, expected, rtol=1e-8)


@pytest.mark.parametrize("axis", AXES)
def test_nine_parameters_have_ten_channels(axis):
    problem = generalised(axis, parametric_plant(axis, reduced=False))
    assert problem.structure.rows == 10
    assert problem.close(controller(axis)).poles().real.max() < 0


@pytest.mark.parametrize("axis", AXES)
def test_weights(axis):
    for speed in (1.0, 5.0):
        found = response(performance_weight(axis, speed), OMEGA)[:, 0, 0]
        np.testing.assert_allclose(found, performance(axis, speed), rtol=1e-10)
    assert optical_gain(axis) == pytest.approx(
        {"focus": 279.95e3, "radial": 998.0e3}[axis], rel=1e-4
    )
    assert control_weight(axis).D[0, 0] == 1 / (100 * optical_gain(axis))
    with pytest.raises(InputError, match="speed"):
        performance_weight(axis, 0.0)
