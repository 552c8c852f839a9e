"""The loops that figures of mu synthesis draw are those of the plants of the set."""

import control
import numpy as np
import pytest

from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis.mu.member_figures import (
    _instants,
    _step,
    drawn_loops,
    performance_figure,
    steps_figure,
)
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import Parameter, generalised_plant, parametric_lft

K = control.ss([[-20.0]], [[20.0]], [[-0.2]], [[0.0]])


def spring(k):
    return [[0, 1], [-k, -2]], [[0], [100]], [[1, 0]], [[0]]


def plant():
    model = parametric_lft(spring, [Parameter("k", 45.0, 0.2)], inputs="f", outputs="x")
    sums = {"f": "u + d", "y": "x + n"}
    signals = {"exogenous": ("d", "n"), "performance": ("x", "u")}
    return generalised_plant([model], sums, control="u", measurement="y", **signals)


def test_the_nominal_is_the_loop_closed_by_hand():
    found = drawn_loops(plant(), K)
    assert (found.performance, found.inputs) == (2, ["d", "n"])
    assert [name.split("[")[0] for name in found.outputs] == ["x", "u", "y", "u"]
    G = control.ss(*spring(45.0))
    s = 2.7j
    L = (G * K)(s)
    expected = np.array(
        [
            [G(s), L],
            [L, K(s)],
            [G(s), 1.0],  # y = x + n
            [L, K(s)],
        ]
    ) / (1 - L)
    np.testing.assert_allclose(found.nominal(s), expected, rtol=1e-9)


def test_random_loops_are_those_of_plants_in_the_set():
    """From d to x: 1 / (x / d) differs from the nominal's by the stiffness alone."""
    found = drawn_loops(plant(), K)
    s = 1.3j
    nominal = found.nominal(s)[0, 0]
    changes = np.array([100 / one(s)[0, 0] - 100 / nominal for one in found.random])
    assert np.abs(changes.imag).max() < 1e-6
    assert np.abs(changes.real).max() <= 0.2 * 45.0 * (1 + 1e-9)
    assert np.ptp(changes.real) > 9.0


@pytest.mark.parametrize("period", [None, 0.01])
def test_a_step_is_that_of_another_simulation_and_ends_at_rest(period):
    loop = drawn_loops(plant(), K).nominal[2:, 0]
    if period:
        loop = control.sample_system(loop, period)
    time = _instants(loop)
    values = _step(loop, time)
    expected = np.squeeze(control.step_response(loop, time).outputs).T
    np.testing.assert_allclose(values, expected, atol=1e-7 * np.abs(expected).max())
    final = np.real(loop.dcgain()).ravel()
    largest = np.abs(values).max(axis=0)
    assert (np.abs(values[-1] - final) < 0.1 * largest).all()
    assert (np.abs(values[len(time) // 4] - final) > 0.02 * largest).any()


@pytest.mark.parametrize("peak", [0.8, 1.3])
def test_a_peak_above_one_is_no_bound_for_the_whole_set(peak):
    figure = performance_figure(drawn_loops(plant(), K), peak)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert ("certified for all plants: 0.8" in names) == (peak < 1)
    assert "20 random plants" in names


def test_blocks_of_any_name_and_size_and_none_at_all_are_drawn():
    rng = np.random.default_rng(1)
    system = control.ss(
        -np.diag(np.arange(1.0, 6)),
        0.1 * rng.standard_normal((5, 8)),
        0.1 * rng.standard_normal((7, 5)),
        np.zeros((7, 8)),
    )
    blocks = Structure([Real(2, name="a b"), Complex(1, name="a b"), Full(2, 1, name="")])
    for structure in (blocks, None):
        given = GeneralisedPlant(system, structure, controls=1, measurements=1)
        loops = drawn_loops(given, K)
        assert len(loops.random) == (20 if structure else 0)
        steps = steps_figure(loops)
        assert len(steps.axes) == 2 * (2 if structure else 3)  # of at most three inputs
        assert all("[its own unit]" in panel.get_ylabel() for panel in steps.axes[:1])
        assert performance_figure(loops, 0.5).axes
