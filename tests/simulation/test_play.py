"""Playing a record through a controller, against SciPy's filter, and what it refuses."""

import control
import numpy as np
import pytest
from scipy.signal import lfilter

from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.simulation import Controller, linear_controller, play


@compiled
def _root(state, parameters, measurement, output):
    output[0] = np.sqrt(measurement[0])


def test_a_linear_filter_against_scipy():
    rng = np.random.default_rng(1)
    b, a = [0.2, 0.1], [1.0, -0.7]
    record = rng.standard_normal((200, 2))
    filtered = play(linear_controller(control.tf(b, a, 1e-3), 1e-3, measurements=(1,)), record)
    assert filtered[:, 0] == pytest.approx(lfilter(b, a, record[:, 1]), abs=1e-12)


def test_its_first_state_is_left_alone():
    rng = np.random.default_rng(2)
    filtering = linear_controller(control.tf([1.0], [1.0, -0.5], 1e-3), 1e-3)
    record = rng.standard_normal((20, 1))
    assert (play(filtering, record) == play(filtering, record)).all()


@pytest.mark.parametrize("record", [np.zeros(5), np.zeros((0, 1)), np.array([[1.0], [np.nan]])])
def test_records_that_are_none(record):
    with pytest.raises(InputError, match="the record has"):
        play(linear_controller(control.tf([1.0], [1.0], 1e-3), 1e-3), record)


def test_an_output_that_is_not_finite_is_named_with_its_sample():
    with pytest.raises(InputError, match="at sample 2 of 4"):
        play(Controller(_root, np.zeros(0), np.zeros(0)), [[1.0], [2.0], [-1.0], [1.0]])


def test_plain_python_gives_what_compiled_code_gives():
    record = np.random.default_rng(0).uniform(0.0, 1.0, (50, 1))
    compiled_root = Controller(_root, np.zeros(0), np.zeros(0))
    plain_root = Controller(_root.py_func, np.zeros(0), np.zeros(0), plain=True)
    assert (play(plain_root, record) == play(compiled_root, record)).all()
