"""Plants of several channels: their nominal, and the loop of demands around them."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import Demands, channel_plant, demanded_channels, demanded_plant
from workbench.systems.generalised_plant import response
from workbench.uncertainty import UncertaintyModel

OMEGA = np.geomspace(1e-3, 30.0, 25)
ASKED = Demands(bandwidth=0.3, effort=0.05, overshoot=0.2)


def model(gain, lag, radius=0.1):
    return UncertaintyModel(control.tf([gain], [lag, 1.0]), control.tf([radius], [1.0]))


def rows(u_units=(1.0, 1.0), y_units=(1.0, 1.0)):
    """Two outputs and inputs, expressed in units of these sizes."""
    gains, lags = [[2.0, 1.0], [-0.5, 3.0]], [[3.0, 2.0], [5.0, 1.0]]
    return [
        [model(gains[i][j] * u_units[j] / y_units[i], lags[i][j]) for j in (0, 1)] for i in (0, 1)
    ]


def test_the_nominal_has_the_response_of_every_channel():
    found = response(channel_plant(rows()), OMEGA)
    for i, row in enumerate(rows()):
        for j, one in enumerate(row):
            np.testing.assert_allclose(found[:, i, j], one.nominal.response(OMEGA), rtol=1e-12)


def test_one_channel_has_the_loop_of_one_channel():
    one = model(2.0, 3.0)
    single = demanded_plant(one, ASKED, 0.1, delay_samples=1.0)
    found = demanded_channels([[one]], ASKED, 0.1, sizes=([1.0], [1.0]), delay_samples=1.0)
    np.testing.assert_allclose(
        response(found.system, OMEGA), response(single.system, OMEGA), rtol=1e-9, atol=1e-12
    )


def test_units_of_the_signals_do_not_matter():
    """With a controller in the same units, the loop of perturbations and weights is the same."""
    u_units, y_units = np.array([10.0, 0.2]), np.array([0.5, 40.0])
    K = np.array([[0.3, -0.1], [0.05, 0.2]])
    plain = demanded_channels(rows(), ASKED, 0.1, sizes=([1.0, 2.0], [3.0, 1.0]))
    other = demanded_channels(
        rows(u_units, y_units),
        ASKED,
        0.1,
        sizes=(np.array([1.0, 2.0]) / u_units, np.array([3.0, 1.0]) / y_units),
    )
    closed = response(plain.close(gain(K)), OMEGA)
    turned = response(other.close(gain(K * y_units / u_units[:, None])), OMEGA)
    performance = slice(len(plain.structure), None)
    np.testing.assert_allclose(
        np.abs(turned[:, performance, performance]),
        np.abs(closed[:, performance, performance]),
        rtol=1e-7,
        atol=1e-12,
    )


def gain(K):
    return control.ss([], [], [], K)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"models": [[model(1.0, 1.0)], []]}, "rows of equal length"),
        ({"demands": Demands(recovery_time=3.0)}, "takes demands among bandwidth"),
        ({"demands": Demands()}, "demanded is nothing"),
        ({"sizes": ([1.0], [1.0, 1.0])}, "sizes of the inputs are"),
        ({"sizes": ([1.0, 1.0], [1.0, -1.0])}, "sizes of the outputs are"),
        ({"sizes": ([1.0, 1.0],)}, "sizes of the inputs and of the outputs are needed"),
    ],
)
def test_what_does_not_fit_is_refused(given, words):
    full = {"models": rows(), "demands": ASKED, "sizes": ([1.0, 1.0], [1.0, 1.0])} | given
    with pytest.raises(InputError, match=words):
        demanded_channels(full["models"], full["demands"], 0.1, sizes=full["sizes"])
