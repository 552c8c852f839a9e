"""Families with zeros, observers and matrices of one's own: responses, slopes, members."""

import cloudpickle
import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import (
    PI,
    PID,
    LeadLag,
    Modal,
    ObserverForm,
    Parametrised,
    Sparse,
    Static,
    hinf,
)
from workbench.systems.generalised_plant import GeneralisedPlant, response

OMEGA = np.geomspace(0.05, 30.0, 7)
TWO = control.ss([[0.5, 1.0], [0.0, -1.0]], [[0.0, 1.0], [1.0, 0.3]], [[1.0, 0.0]], [[0.2, 0.0]])


def lag_in_series(x):
    """A PI with a free lag, whose entries are products of the parameters."""
    return [[0.0, 0.0], [x[0] * x[1], -x[2]]], [[1.0], [x[0]]], [[0.0, x[2]]], [[0.0]]


FAMILIES = {
    "sparse": Sparse([[PI(), None, Static()], [LeadLag(sign=1), PID(), None]]),
    "sparse modal": Sparse([[Modal(2), None], [None, Modal(1)]]),
    "observer": ObserverForm(TWO),
    "own": Parametrised(lag_in_series, [1.0, 0.5, 4.0]),
}


def drawn(name, seed):
    family = FAMILIES[name]
    rng = np.random.default_rng(seed)
    x = rng.normal(size=family.count)
    return family, np.abs(x) + 0.2 if name == "own" else x


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", FAMILIES)
def test_responses_are_those_of_the_system_and_slopes_those_of_differences(name, seed):
    family, x = drawn(name, seed)
    K, slopes = family.response(x, OMEGA)
    np.testing.assert_allclose(K, response(family.system(x), OMEGA), rtol=1e-8, atol=1e-10)
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-6
        ends = [response(family.system(x + sign * step), OMEGA) for sign in (1, -1)]
        np.testing.assert_allclose(
            slopes[:, k], (ends[0] - ends[1]) / 2e-6, rtol=1e-4, atol=1e-5 * np.abs(K).max()
        )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", FAMILIES)
def test_a_member_has_parameters_of_its_own_response(name, seed):
    family, x = drawn(name, seed)
    K = family.system(x)
    own, y = family.about(K)
    again = own.system(y)
    np.testing.assert_allclose(response(again, OMEGA), response(K, OMEGA), rtol=1e-6, atol=1e-8)
    assert cloudpickle.loads(cloudpickle.dumps(own)).count == own.count


def test_zeros_stay_zeros_and_others_are_told():
    family, x = drawn("sparse", 4)
    K = family.system(x)
    size = np.abs(response(K, OMEGA)).max(axis=0)
    assert (size == 0.0).tolist() == [[False, True, False], [False, False, True]]
    assert family.settings(K)["entry 1,3 gain"] == pytest.approx(x[2])
    D = np.ones((2, 3))
    with pytest.raises(InputError, match="output 0 of the controller answers input 1"):
        family.about(control.ss([], [], [], D))


def test_an_observer_in_other_states_is_known():
    family = FAMILIES["observer"]
    K = family.examples(1.0, 1.0)[0]
    T = np.array([[1.0, 2.0], [-0.3, 1.0]])
    moved = control.ss(np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T, K.D)
    again = family.system(family.parameters(moved))
    np.testing.assert_allclose(response(again, OMEGA), response(K, OMEGA), rtol=1e-7)
    assert np.abs(again.A - moved.A).max() > 1e-3


def test_a_full_order_controller_has_the_form_of_an_observer():
    B = np.hstack([np.eye(2), np.zeros((2, 1)), TWO.B])
    C = np.vstack([np.eye(2), np.zeros((2, 2)), TWO.C])
    D = np.zeros((5, 5))
    D[2:4, 3:], D[4, 2], D[4, 3:] = np.eye(2), 1.0, TWO.D
    K = hinf(GeneralisedPlant(control.ss(TWO.A, B, C, D), None, 2, 1)).K
    family = ObserverForm(TWO)
    F, L = family.gains(family.parameters(K))
    # the separation principle: the loop's poles are those of state feedback and of the estimate
    loop = np.block([[TWO.A, TWO.B @ K.C], [K.B @ TWO.C, K.A + K.B @ TWO.D @ K.C]])
    apart = [np.linalg.eigvals(TWO.A + TWO.B @ F), np.linalg.eigvals(TWO.A - L @ TWO.C)]
    np.testing.assert_allclose(
        np.sort_complex(np.concatenate(apart)), np.sort_complex(np.linalg.eigvals(loop)), rtol=1e-6
    )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Sparse([[PI(), PI(setpoint_weights=True)]]), "2 inputs"),
        (lambda: Sparse([[None, None]]), "every entry is zero"),
        (lambda: Sparse([[PI()], [PI(), None]]), "1, 2 entries"),
        (lambda: Sparse([[PI]]), r"write PI\(\)"),
        (lambda: ObserverForm(control.ss([], [], [], [[1.0]])), "no states"),
        (lambda: Parametrised(lambda x: (x,), [1.0]), "1 parts"),
        (
            lambda: Parametrised(lambda x: ([[x[0]]], [[1.0]], [[1.0, 2.0]], [[0.0]]), [1.0]),
            "C has",
        ),
        (lambda: Parametrised(lambda x: x[9], [1.0]), "fails"),
        (lambda: Parametrised(lambda x: ([[1 / x[0]]], [[1]], [[1]], [[0]]), [0.0]), "finite"),
    ],
)
def test_what_no_family_is(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_what_is_no_member():
    family = FAMILIES["observer"]
    for K, said in (
        (control.ss([[-1.0]], [[1.0]], [[1.0], [0.0]], [[0.0], [0.0]]), "1 states"),
        (control.ss(-np.eye(2), np.ones((2, 1)), np.eye(2), [[0.0], [1.0]]), "direct term"),
    ):
        with pytest.raises(InputError, match=said):
            family.parameters(K)
    with pytest.raises(InputError, match="no member"):
        FAMILIES["own"].parameters(control.ss(-np.eye(2), [[1.0], [2.0]], [[1.0, 1.0]], [[3.0]]))
    with pytest.raises(InputError, match="states"):
        FAMILIES["own"].parameters(control.ss([], [], [], [[3.0]]))
