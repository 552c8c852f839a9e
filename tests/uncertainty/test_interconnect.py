"""Uncertain systems connected by names, against the same systems by arithmetic."""

import control
import numpy as np
import pytest

from workbench.errors import InputError, UnknownNameError
from workbench.uncertainty import append, dynamics, feedback, interconnect, real, tf

S = 0.3 + 1.1j
A = real("a", 1, percent=20)
G = tf([1], [1, A])
K = control.tf([2], [1, 0], inputs="e", outputs="u", name="K")


@pytest.mark.parametrize("value", [0.8, 1.0, 1.2])
def test_a_loop_is_what_feedback_makes_of_it(value):
    found = interconnect([(G, "u", "y"), K], {"e": "r - y"}, inputs="r", outputs=["e", "y"])
    L = G * control.tf([2], [1, 0])
    expected = [feedback(1, L), feedback(L, 1)]
    got = found.at(a=value)(S)[:, 0]
    np.testing.assert_allclose(got, [one.at(a=value)(S) for one in expected], rtol=1e-9)


def test_an_element_in_two_blocks_is_one():
    found = interconnect(
        [(G, "u", "y"), (2 * G, "u", "z")], {"s": "y - z"}, inputs="u", outputs=["s", "u"]
    )
    assert list(found.elements) == ["a"]
    expected = -1 / (S + 0.9)
    assert found.at(a=0.9)(S)[0, 0] == pytest.approx(expected)
    assert found.at(a=0.9)(S)[1, 0] == pytest.approx(1.0)


def test_dynamics_and_matrices_by_name():
    delta = dynamics("delta", 2, 2, bound=0.1)
    plant = append(G, tf([1], [1, 3]))
    found = interconnect(
        [(plant, ["v1", "v2"], ["y1", "y2"]), (delta, ["u1", "u2"], ["d1", "d2"])],
        {"v1": "u1 + d1", "v2": "u2 + d2"},
        inputs=["u1", "u2"],
        outputs=["y1", "y2"],
    )
    D = 0.5 * np.eye(2)
    expected = (plant.at(a=1.1) * (np.eye(2) + 0.1 * D))(S)
    np.testing.assert_allclose(found.at(a=1.1, delta=control.ss([], [], [], D))(S), expected)


BLOCKS, ENDS = [(G, "u", "y")], {"inputs": "u", "outputs": "y"}
SAMPLED = control.ss(0.5, 1, 1, 0, 0.1)


@pytest.mark.parametrize(
    ("blocks", "sums", "ends", "error", "words"),
    [
        (BLOCKS, {}, {"inputs": "u", "outputs": "x"}, UnknownNameError, "x"),
        (BLOCKS, {}, {"inputs": [], "outputs": "y"}, UnknownNameError, "u"),
        (BLOCKS, {}, {"inputs": ["u", "w"], "outputs": "y"}, InputError, "nothing reads the input"),
        (BLOCKS, {"y": "u"}, ENDS, InputError, "'y' is driven 2 times"),
        (BLOCKS, [["G.u", "Q.y"]], ENDS, InputError, "find system"),
        (BLOCKS, {"e": "r * y"}, ENDS, InputError, "sum 'e'"),
        ([(G, "u")], {}, ENDS, InputError, "system 1 is"),
        ([G], {}, ENDS, InputError, "system 1 has no names of signals"),
        ([(G, ["u", "w"], "y")], {}, ENDS, InputError, "was given the names"),
        ([("G", "u", "y")], {}, ENDS, InputError, "system 1 must be"),
        (None, {}, ENDS, InputError, "syslist"),
        ([], {}, {"inputs": [], "outputs": []}, InputError, "nothing to connect"),
        ([(1.0, "e", "y")], {"e": "u + y"}, ENDS, InputError, "singular"),
        ([(G, "u", "x"), (SAMPLED, "x", "y")], {}, ENDS, InputError, "go together"),
    ],
)  # fmt: skip
def test_bad_connections(blocks, sums, ends, error, words):
    with pytest.raises(error, match=words):
        interconnect(blocks, sums, **ends)
