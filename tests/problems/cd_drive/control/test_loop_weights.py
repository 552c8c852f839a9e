"""Weights of a CD drive's loop, against those of its channels."""

from dataclasses import replace

import control
import numpy as np
from workbench.plants.cd_drive.control.loop_weights import CHANNELS, channel_of, loop_weights
from workbench.plants.cd_drive.drive.plants import ANTIALIASING

from workbench.fitting.rational import Rational
from workbench.mu import rank_one_mu
from workbench.uncertainty import UncertaintyModel


def test_weights_of_a_drive_give_the_mu_of_its_loop():
    G = Rational([-300.0], [-20 + 200j, -20 - 200j, -9e3], 5e6)
    W_c, W_r = Rational([-50.0], [-900.0], 0.3), Rational([-80.0], [-700.0], 0.2)
    model = UncertaintyModel(G, W_c, W_r)
    K = control.tf([3e-3, 2.0], [1e-5, 1.0])
    omega = np.geomspace(10, 1e5, 50)
    found = loop_weights("focus", model, 5.0, omega)
    L = K(1j * omega) * G.response(omega) / (1 + 1j * omega / ANTIALIASING)
    T = L / (1 + L)
    for name in CHANNELS:
        loop = channel_of("focus", G, K, name, 5.0, omega)
        zero = np.zeros(omega.shape)
        if name == "disturbance":
            alone = replace(found, control=zero).mu(T)
        else:
            real, circular = found.real * T, found.circular * np.abs(T)
            alone = rank_one_mu(real, circular + found.control * np.abs(T))
        real = -W_r.response(omega) * -loop.uncertain
        others = np.abs(W_c.response(omega) * loop.uncertain) + np.abs(loop.performance)
        np.testing.assert_allclose(alone, rank_one_mu(real, others), rtol=1e-9)
    circles = loop_weights("focus", UncertaintyModel(G, W_c), 5.0, omega)
    assert not circles.real.any()
