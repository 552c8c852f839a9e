"""What a record leaves open has an infinite deviation; what is no model is refused."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.identification import arx, as_experiments, read_record, response_deviations
from workbench.identification.innovations.uncertainty import magnitude_deviations, model_deviations

FREQUENCY = [0.01, 0.1]


def record(mix, samples=600):
    """A record of two inputs, the second of which is mixed from the first and one of its own."""
    rng = np.random.default_rng(2)
    one, other = rng.standard_normal((2, samples))
    u = np.column_stack([one, mix(one, other)])
    plant = control.tf([0.5], [1, -0.5], 1.0)
    y = control.forced_response(plant, inputs=u.sum(axis=1)).outputs
    return as_experiments(u, y + 0.1 * rng.standard_normal(samples), assume="inputs move apart")


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gains_of_two_equal_inputs_are_open(order):
    equal = record(lambda one, other: one)
    model = arx(equal, order=order)
    found = model_deviations(model, equal)
    assert np.isinf(found.gain_deviations).all()
    assert np.isfinite(found.pole_deviations).all()
    assert np.isinf(response_deviations(model, equal, FREQUENCY)).all()
    assert np.isinf(magnitude_deviations(model, equal, FREQUENCY)).all()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_gains_of_inputs_of_their_own_are_not(order):
    apart = record(lambda one, other: other)
    model = arx(apart, order=order)
    found = model_deviations(model, apart)
    assert (found.gain_deviations < 0.1).all()
    assert np.isfinite(response_deviations(model, apart, FREQUENCY)).all()


def test_gains_of_nearly_equal_inputs_are_as_uncertain_as_they_are():
    near = record(lambda one, other: 3 * one + 1e-3 * other)
    model = arx(near, order=1)
    found = model_deviations(model, near)
    assert (np.abs(found.gains - 1) < 4 * found.gain_deviations).all()
    assert (found.gain_deviations > 1).all()


ONE = as_experiments(np.random.default_rng(3).standard_normal((2, 100)), np.arange(100.0) % 7)
MODEL = arx(ONE, order=1)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"model": None}, "model must be a InnovationsModel, not NoneType"),
        ({"model": control.ss(-1, 1, 1, 0)}, "not StateSpace"),
        ({"record": None}, "record must be a Experiments"),
        ({"cycles_per_sample": None}, "cycles_per_sample is None"),
        ({"cycles_per_sample": [np.nan]}, "finite numbers"),
        ({"record": as_experiments(np.arange(50.0) % 5, np.arange(50.0) % 7)}, "1 outputs and 2"),
    ],
)
def test_what_has_no_deviations_is_refused(wrong, message):
    given = {"model": MODEL, "record": ONE, "cycles_per_sample": FREQUENCY} | wrong
    with pytest.raises(InputError, match=message):
        response_deviations(given["model"], given["record"], given["cycles_per_sample"])


def test_a_dataset_is_a_record_without_more(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("time,u,y\n" + "".join(f"{0.1 * k:.1f},{k % 3},{k % 5}\n" for k in range(30)))
    data = read_record(file, inputs=["u"], outputs=["y"], time="time")
    assert as_experiments(data).dt == pytest.approx(0.1)
    assert as_experiments([data, data]).starts == (0, 30)
    for wrong in (None, 3, np.ones(5), [], data[["u"]]):
        with pytest.raises(InputError):
            as_experiments(wrong)
