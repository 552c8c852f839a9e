"""Real plants for the corners of a stated spread."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.synthesis import Implementation, WorkingLoop, WorkingPoint
from workbench.synthesis.operation.stated_plants import stated_corners, without
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.responses.spread import spread_about

G = control.ss(control.tf([1.0], [12.0, 8.0, 1.0]))  # lags of 2 s and 6 s
OMEGA = np.geomspace(0.02, 1.0, 30)  # rad/s


def stated(spread):
    values = G(1j * OMEGA)[:, None]
    found = {
        "frequency_hz": OMEGA / (2 * np.pi),
        "values": values,
        "variance": 1e-8 * np.abs(values) ** 2,
        "degrees": np.array([30.0]),
    }
    return Responses(**spread_about(found, spread, None))


def test_corners_become_real_plants_of_the_disc():
    responses, at = stated(0.25), 0.3
    turned = stated_corners(responses)
    assert sorted(turned) == [1, 2, 3, 4, 5, 7, 8, 9, 10, 11]  # 0 and 6 are gains
    size = responses.values[0, 0] / G(1j * OMEGA[0])
    wide = np.geomspace(1e-4, 1e3, 40)
    for k, corner in turned.items():
        plant = corner.plant(size.real * G, at)
        offset = plant(1j * at) / G(1j * at) - 1
        wanted = responses.values[3, k] / G(1j * OMEGA[3]) - 1
        assert offset == pytest.approx(0.25 * wanted / abs(wanted), rel=1e-9)
        everywhere = plant(1j * wide) / G(1j * wide)
        assert np.abs(everywhere - 1) == pytest.approx(0.25, rel=1e-6)
        assert plant.poles().real.max() < 0 and abs(plant(0.0).imag) < 1e-12


def test_measured_plants_are_no_corners():
    rng = np.random.default_rng(0)
    values = G(1j * OMEGA)[:, None] * np.array([0.9, 1.0, 1.1])
    assert not stated_corners(Responses(omega=OMEGA, values=values))
    noisy = values * (1 + 1e-6 * rng.standard_normal(values.shape))
    assert not stated_corners(Responses(omega=OMEGA, values=noisy))
    rest = without(stated(0.2), stated_corners(stated(0.2)))
    assert rest.values.shape == (30, 2) and stated_corners(rest) == {}


def test_a_loop_of_a_stated_spread_leaves_no_error():
    """Models fitted to the corners themselves had static gains of the other sign."""
    model = UncertaintyModel(G, control.ss([], [], [], [[0.27]]))
    K = control.tf([1.5, 0.25], [1.0, 0.0])
    point = WorkingPoint(40.0, 50.0, u_unit="%", y_unit="K")
    task = Implementation(model, K, dt=0.5, limits=(0.0, 100.0), working_point=point)
    loop = wb.solve(WorkingLoop(stated(0.25), wb.solve(task)))
    assert loop.certificate.holds, str(loop.certificate)
    assert loop.metrics["static_error"] < 1e-3
