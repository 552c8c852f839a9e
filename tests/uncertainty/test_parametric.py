"""Parametric uncertainty: the two-mass model of a CD drive, and what is refused."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive.actuator import SERIES_RESISTANCE, specific_model
from workbench.plants.cd_drive.drive.tables import ActuatorParameters, nominal_table
from workbench.plants.cd_drive.uncertainty.parametric_model import two_masses

from workbench.errors import InputError, UnknownNameError
from workbench.structure import Real
from workbench.uncertainty.parametric_models.model import parametric_lft
from workbench.uncertainty.parametric_models.parameters import (
    Parameter,
    random_deltas,
    vertex_deltas,
)

OMEGA = 2 * np.pi * np.geomspace(0.1, 1e5, 60)
NAMES = ("K_total", "R", "Bl", "k1", "k2", "b1", "b2", "m1", "m2")


def by_hand(K_total, R, Bl, k1, k2, b1, b2, m1, m2):
    """As `two_masses`, its elements multiplied out."""
    r = R + SERIES_RESISTANCE
    A = [
        [0, 0, 1, 0],
        [0, 0, 0, 1],
        [-k2 / m1, k2 / m1, -(b2 + Bl**2 / r) / m1, b2 / m1],
        [k2 / m2, -(k1 + k2) / m2, b2 / m2, -(b1 + b2) / m2],
    ]
    return A, [[0], [0], [Bl / (r * m1)], [0]], [[K_total, 0, 0, 0]], 0


def parameters(axis="focus"):
    return [Parameter(n, p.nominal, p.tolerance) for n, p in nominal_table(axis).items()]


def drive(model, axis="focus", **options):
    return parametric_lft(model, parameters(axis), inputs=["u"], outputs=["f_en"], **options)


def printed(axis, delta):
    """Response by the equations of the actuator, which know no LFT."""
    values = {p.name: float(p.at(d)) for p, d in zip(parameters(axis), delta, strict=True)}
    gain = values.pop("K_total")
    return gain * specific_model(ActuatorParameters(**values)).response(OMEGA / (2 * np.pi))


@pytest.mark.parametrize("keep_states", [True, False])
@pytest.mark.parametrize("axis", ["focus", "radial"])
@pytest.mark.parametrize("model", [two_masses, by_hand])
def test_exact_at_random_deltas(model, axis, keep_states):
    uncertain = drive(model, axis, keep_states=keep_states)
    deltas = random_deltas(uncertain.parameters, 12, np.random.default_rng(1))
    responses = uncertain.response(OMEGA, deltas)
    assert responses.shape == (12, len(OMEGA), 1, 1)
    expected = np.array([printed(axis, delta) for delta in deltas])
    np.testing.assert_allclose(responses[..., 0, 0], expected, rtol=1e-9)
    assert uncertain.states == 4


def test_every_parameter_once_but_the_force_factor():
    uncertain = drive(two_masses)
    counts = {name: after for name, (_, after) in uncertain.repetitions.items()}
    assert counts == dict.fromkeys(NAMES, 1) | {"Bl": 2}
    assert uncertain.structure.blocks == tuple(Real(counts[name], name=name) for name in NAMES)
    assert all(before >= after for before, after in uncertain.repetitions.values())
    # Elements multiplied out hide that they share a factor: more copies, never fewer.
    assert sum(after for _, after in drive(by_hand).repetitions.values()) == 13


def test_states_keep_their_meaning():
    uncertain = drive(two_masses)
    for delta in vertex_deltas(uncertain.parameters)[::73]:
        at, direct = uncertain.at(delta), uncertain.direct(delta)
        for name in "ABCD":
            expected = getattr(direct, name)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(getattr(at, name), expected, atol=1e-13 * scale)


def test_delta_closes_the_upper_loop_of_the_system():
    uncertain = drive(two_masses)
    delta = random_deltas(uncertain.parameters, 1, np.random.default_rng(2))[0]
    system, r = uncertain.system, uncertain.structure.rows
    assert system.input_labels[r:] == ["u"] and system.output_labels[r:] == ["f_en"]
    assert system.input_labels[1:4] == ["w_R[0]", "w_Bl[0]", "w_Bl[1]"]
    Delta = np.diag(np.repeat(delta, [b.rows for b in uncertain.structure]))
    D11, D12 = system.D[:r, :r], system.D[:r, r:]
    loop = np.linalg.inv(np.eye(r) - Delta @ D11) @ Delta
    A = system.A + system.B[:, :r] @ loop @ system.C[:r]
    B = system.B[:, r:] + system.B[:, :r] @ loop @ D12
    closed = control.ss(A, B, system.C[r:], 0.0)
    poles = np.sort_complex(closed.poles())
    np.testing.assert_allclose(poles, np.sort_complex(uncertain.direct(delta).poles()), rtol=1e-8)


def test_deltas_by_name_or_in_order():
    uncertain = drive(two_masses)
    order = np.zeros(9)
    order[NAMES.index("R")] = 0.5
    np.testing.assert_array_equal(uncertain.at({"R": 0.5}).A, uncertain.at(order).A)
    batch = uncertain.response(OMEGA[:2], {"R": [0.0, 0.5], "m1": 0.1})
    assert batch.shape == (2, 2, 1, 1)
    with pytest.raises(UnknownNameError, match="did you mean Bl"):
        uncertain.at({"BI": 0.5})
    with pytest.raises(InputError, match=r"\(\.\.\., 9\)"):
        uncertain.at(np.zeros(8))
    with pytest.raises(InputError, match="give one set at a time"):
        uncertain.at(np.zeros((2, 9)))


def test_states_that_do_nothing_are_left_out_on_request():
    def model(a):
        return np.diag([-a, -2.0, 3.0]), [[a], [0], [1.0]], [[1.0, 1.0, 0]], 0

    def system(**options):
        parts = [Parameter("a", 2.0, 0.5)]
        return parametric_lft(model, parts, inputs="u", outputs="y", **options)

    assert system().states == 3
    assert system(keep_states=False).states == 1
    difference = [system(keep_states=k).response(OMEGA, {"a": 0.7}) for k in (True, False)]
    np.testing.assert_allclose(*difference, rtol=1e-12)
    assert system().repetitions == {"a": (2, 1)}


def test_slow_states_beside_fast_ones_stay():
    def model(a):  # 1e7 / (s + 1e7) + 1e-6 a / (s + 1e-3)
        return np.diag([-1e7, -1e-3]), [[1e7], [1e-6 * a]], [[1.0, 1.0]], 0

    parts = [Parameter("a", 2.0, 0.5)]
    kept, least = (
        parametric_lft(model, parts, inputs="u", outputs="y", keep_states=keep)
        for keep in (True, False)
    )
    assert least.states == 2
    omega = np.geomspace(1e-5, 1e9, 30)
    responses = [m.response(omega, {"a": 0.7}) for m in (kept, least)]
    np.testing.assert_allclose(*responses, rtol=1e-12)


def test_a_mass_that_may_vanish():
    wide = [Parameter(p.name, p.nominal, 1.2 if p.name == "m2" else 0.1) for p in parameters()]
    with pytest.raises(InputError, match=r"nominal and m2 = -4.8e-06 \(delta -1\); narrow"):
        parametric_lft(two_masses, wide, inputs=["u"], outputs=["f_en"])


def test_a_model_that_is_singular_in_a_corner_only():
    def model(a, b, c):
        return -c / (3 - a - b), 1.0, 1.0, 0.0

    def make(tolerance):
        parts = [Parameter(name, 1.0, tolerance) for name in "abc"]
        return parametric_lft(model, parts, inputs=["u"], outputs=["y"])

    with pytest.raises(InputError, match=r"a = 1.6 \(delta \+1\), b = 1.6 \(delta \+1\); narrow"):
        make(0.6)
    uncertain = make(0.4)
    with pytest.raises(InputError, match=r"delta of a = 1\.25"):
        uncertain.at([1.25, 1.25, 0.0])


@pytest.mark.parametrize(
    "model, message",
    [
        (lambda a: (1 / (a - 2.0), 1.0, 1.0, 0.0), "singular at the nominal"),
        (lambda a: (np.sqrt(a), 1.0, 1.0, 0.0), "rational"),
        (lambda a: (max(a, 1.0), 1.0, 1.0, 0.0), "rational"),
        (lambda b: (b, 1.0, 1.0, 0.0), "arguments"),
        (lambda a: (a**0.5, 1.0, 1.0, 0.0), "integer powers"),
        (lambda a: (-1.0, 1.0, 1.0, 0.0), "none of its parameters"),
        (lambda a: ([[a, 1.0]], 1.0, 1.0, 0.0), "square"),
        (lambda a: (a, [[1.0], [1.0]], 1.0, 0.0), "below|beside"),
        (lambda a: (a, [[1.0, 1.0]], 1.0, [[0.0, 0.0]]), "2 inputs and 1 outputs"),
    ],
)
def test_models_that_are_refused(model, message):
    with pytest.raises(InputError, match=message):
        parametric_lft(model, [Parameter("a", 2.0, 0.1)], inputs=["u"], outputs=["y"])


def test_lists_of_parameters_that_are_refused():
    def model(a):
        return -a, 1.0, 1.0, 0.0

    with pytest.raises(InputError, match="more than one"):
        parametric_lft(model, [Parameter("a", 1.0, 0.1)] * 2, inputs="u", outputs="y")
    with pytest.raises(InputError, match="at least one"):
        parametric_lft(model, [], inputs="u", outputs="y")


def test_a_pole_on_the_grid():
    integrator = parametric_lft(
        lambda a: (0.0, a, 1.0, 0.0), [Parameter("a", 1.0, 0.1)], inputs="u", outputs="y"
    )
    with pytest.raises(InputError, match="pole"):
        integrator.response([0.0, 1.0], {"a": 0.0})
