"""Calls that python-control takes, against what python-control makes of them."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.uncertainty import append, feedback, interconnect, real, series, ss, tf

S = 0.3 + 1.1j
A = real("a", 1, percent=20)
G = tf([1], [1, A], name="G", inputs="u", outputs="y")
C = control.tf([2], [1, 0], name="C", inputs="e", outputs="u")
NUM, DEN = [[[1], [2]], [[3], [1, 4]]], [[[1, 1], [1, 2]], [[1, 1], [1, 3]]]


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (tf(3, [1, 2]), control.tf(3, [1, 2])),
        (tf([1], [1, 2], 0.1), control.tf([1], [1, 2], 0.1)),
        (tf([1], [1, 2], dt=0.1), control.tf([1], [1, 2], dt=0.1)),
        (tf([1], [1, 2], True), control.tf([1], [1, 2], True)),
        (tf(NUM, DEN), control.tf(NUM, DEN)),
        (tf([[C, 1.0]]), control.tf([[C, control.tf([1], [1], 0)]], dt=0)),
        (tf(C), C),
        (ss(C), control.ss(C)),
        (ss(-1, 1, 1, 0), control.ss(-1, 1, 1, 0)),
        (ss([], [], [], [[1, 2]]), control.ss([], [], [], [[1, 2]])),
        (series(C, tf([1], [1, 5])), control.series(C, control.tf([1], [1, 5]))),
        (append(C, 3.0), control.append(control.ss(C), 3.0)),
        (feedback(C, 1), control.feedback(C, 1)),
        (feedback(sys1=C, sys2=2, sign=1), control.feedback(sys1=C, sys2=2, sign=1)),
    ],
)
def test_systems_without_uncertainty_are_those_of_python_control(ours, theirs):
    np.testing.assert_allclose(ours.nominal(S), theirs(S), rtol=1e-12)
    if theirs.dt is not None:
        assert (ours.dt or 0) == (theirs.dt or 0)


def test_s_and_z_are_python_controls_own():
    s = tf("s")
    assert isinstance(s, control.TransferFunction)
    np.testing.assert_allclose((A / (s + 1)).at(a=0.9)(S), 0.9 / (S + 1))
    assert tf("z").dt is True


def test_rows_of_polynomials_may_be_uncertain():
    found = tf([[[A], [1]]], [[[1, A], [1, 3]]])
    np.testing.assert_allclose(found.at(a=0.9)(S)[0], [0.9 / (S + 0.9), 1 / (S + 3)])


@pytest.mark.parametrize(
    "make",
    [
        lambda **names: tf([1], [1, 2], **names),
        lambda **names: ss(-1, 1, 1, 0, **names),
        lambda **names: feedback(C, 1, **names),
        lambda **names: series(C, C, **names),
        lambda **names: append(C, **names),
    ],
)
def test_keywords_name_a_system_and_its_signals(make):
    found = make(name="H", inputs=["force"], output_prefix="q")
    assert (found.name, found.input_labels, found.output_labels) == ("H", ["force"], ["q[0]"])
    assert "UncertainSystem H:" in repr(found)
    assert (2 * found).name == ""
    assert found[0, 0].input_labels == ["force"]


def ours_and_theirs(**wiring):
    """The same connection of an uncertain system, and of its member at a = 0.9."""
    sums = control.summing_junction(["r", "-y"], "e", name="sum")
    member = control.ss(G.at(a=0.9), name="G", inputs="u", outputs="y")
    return (
        interconnect([G, C, sums], **wiring),
        control.interconnect([member, C, sums], **wiring),
    )


@pytest.mark.parametrize(
    "wiring",
    [
        {"inputs": "r", "outputs": ["y", "u"]},
        {"inputs": "r", "outputs": "y", "name": "T"},
        {"inplist": "sum.r", "outlist": ["G.y", "-C.u"]},
        {
            "connections": [["G.u", "C.u"], ["C.e", "sum.e"], ["sum.y", "G.y"]],
            "inplist": ["sum.r"],
            "outlist": [(0, 0, 2.0), "C.e"],
            "outputs": ["twice", "error"],
        },
        {"inplist": [["sum.r", "G.u"]], "outlist": "G.y", "inputs": "w", "warn_duplicate": False},
    ],
)
def test_wiring_is_python_controls(wiring):
    ours, theirs = ours_and_theirs(**wiring)
    np.testing.assert_allclose(ours.at(a=0.9)(S), theirs(S), rtol=1e-9)
    assert ours.input_labels == theirs.input_labels
    assert ours.output_labels == theirs.output_labels
    assert list(ours.elements) == ["a"]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: tf(), "tf was given 0 arguments"),
        (lambda: tf("q"), "tf was given 'q'"),
        (lambda: tf([1], [1, 2], 0.1, dt=0.1), "dt twice"),
        (lambda: tf([1], [1, 2], states=["x"]), "no use for states="),
        (lambda: tf([1], [1, 2], inputs=["a", "b"]), "the system has 1 inputs"),
        (lambda: tf([[[1]]], [1]), "den needs as many"),
        (lambda: tf(C, dt=0.1), "cannot be given dt"),
        (lambda: ss(1, 2), "ss was given 2 arguments"),
        (lambda: feedback(C, 1, nme="T"), "no use for nme="),
        (lambda: interconnect([G, C], inplist="C.x", outlist="G.y"), "input signal 'C.x'"),
        (lambda: interconnect([G, C], inputs="e"), "inputs= and outputs="),
        (lambda: interconnect([G], [["G.u", "Q.u"]], inplist="G.u", outlist="G.y"), "system 'Q'"),
    ],
)
def test_misuse(call, words):
    with pytest.raises(InputError, match=words):
        call()
