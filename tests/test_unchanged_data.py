"""Nobody changes the data that an answer is certified against."""

from dataclasses import dataclass

import control
import numpy as np
import pytest
import xarray as xr

import workbench as wb
from workbench import program as programs
from workbench._core.arrays import content_hash
from workbench.errors import InputError
from workbench.geometry import SmallestCircle
from workbench.uncertainty import Responses

POINTS = np.array([0.0, 1.0, 1j])


@pytest.fixture
def method(monkeypatch):
    """Registers a method of smallest circles for one test."""
    own = dict(programs.methods(SmallestCircle))
    monkeypatch.setitem(programs._METHODS, SmallestCircle, own)
    return lambda function: wb.method(SmallestCircle, function.__name__, optimal=True)(function)


def test_arrays_of_a_program_are_read_only():
    given = POINTS.copy()
    program = SmallestCircle(given)
    with pytest.raises(ValueError, match="read-only"):
        program.points *= 2
    assert np.array_equal(program.points, POINTS)
    given += 0.0  # that of the user is not


def test_a_method_that_changes_the_data_has_failed(method):
    @method
    def cheat(program, context):
        """Halves the points, where they are kept."""
        array = program.points
        while array.base is not None:
            array = array.base
        array.flags.writeable = True
        array *= 0.5
        return wb.solve(SmallestCircle(array)).answer, wb.Outcome.SOLVED, ""

    program = SmallestCircle(POINTS.copy())
    solution = wb.solve(program, method="cheat")
    assert solution.outcome is wb.Outcome.FAILED and solution.certificate is None
    assert "changed by method 'cheat'" in solution.message
    with pytest.raises(InputError, match="make it anew"):  # honest ones are not judged on it
        wb.solve(program, method="exact")


def test_data_changed_between_two_questions_are_told():
    given = POINTS.copy()
    program = SmallestCircle(given)
    if np.shares_memory(given, program.points):
        assert wb.solve(program).holds
        given *= 2
        with pytest.raises(InputError, match="were changed by somebody"):
            wb.solve(program)


@dataclass
class Holder:
    numbers: np.ndarray
    within: tuple
    name: str = ""


@pytest.mark.parametrize(
    "change",
    [
        lambda h: h.numbers.__setitem__(0, 7.0),
        lambda h: h.within[0]["a"].__setitem__((0, 0), 1e-300),
        lambda h: h.within[1].A.__setitem__((0, 0), -2.0),
        lambda h: h.within[2].values.__setitem__(0, 5.0),
        lambda h: h.within[3].__setitem__("y", ("k", [1.0, 3.0])),
        lambda h: setattr(h, "name", "other"),
    ],
)
def test_the_hash_sees_every_number(change):
    def made():
        parts = {"a": np.zeros((2, 2)), "b": [1, 2.5, None]}
        sets = xr.Dataset({"y": ("k", [1.0, 2.0])})
        array = xr.DataArray(np.ones(3), dims="k")
        return Holder(np.arange(3.0), (parts, control.ss(-1.0, 1, 1, 0), array, sets))

    one, other = made(), made()
    assert content_hash(one) == content_hash(other)
    change(other)
    assert content_hash(one) != content_hash(other)


def test_the_hash_of_odd_things():
    one = control.tf([1.0, 2.0], [1.0, 3.0])
    assert content_hash(one) != content_hash(control.tf([1.0, 2.5], [1.0, 3.0]))
    assert content_hash(np.zeros((0, 3))) != content_hash(np.zeros((3, 0)))
    assert content_hash(np.array(1.0)) != content_hash(np.array(1))
    circular: list = [1.0]
    circular.append(circular)
    assert content_hash(circular)
    omega = np.geomspace(1, 10, 5)
    responses = Responses(omega=omega, values=np.ones((5, 2)) + 0j)
    assert content_hash(responses) != content_hash(
        Responses(omega=omega, values=2 * np.ones((5, 2)) + 0j)
    )
