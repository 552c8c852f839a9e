"""What draws itself: data, models, answers and controllers, each with labelled axes."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError, UnknownNameError
from workbench.geometry import SmallestCircle
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.solvers import Options
from workbench.synthesis import HinfSynthesis
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import Responses, UncertaintyModel

OMEGA = np.geomspace(1.0, 100.0, 30)
B, C = [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]]
SCALAR = control.ss([[1.0]], B, C, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
POINTS = np.array([0.0, 1.0, 1j])


def lag(gain):
    return gain / (1 + 1j * OMEGA / 10)


def responses(count):
    return Responses(
        omega=OMEGA, values=np.stack([lag(1 + k / 10) for k in range(count)], axis=1), unit="m/V"
    )


def estimate():
    response = np.stack([[lag(1.0), lag(2.0)]], axis=0).transpose(2, 0, 1)
    return ResponseEstimate(OMEGA / (2 * np.pi), response, np.full(response.shape, 1e-4), 20.0)


@pytest.mark.parametrize("count", [3, 12])
def test_responses(count):
    figure = responses(count).plot()
    top, bottom = figure.axes
    assert top.get_ylabel() == "magnitude [m/V]"
    assert bottom.get_xlabel() == "frequency [Hz]"
    drawn = np.abs(top.lines[1].get_ydata())
    np.testing.assert_allclose(drawn, np.abs(lag(1.1)))
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == (["1", "2", "3"] if count == 3 else ["12 plants"])


def test_an_estimate_has_its_band():
    figure = estimate().plot(confidence=0.9)
    assert len(figure.axes[0].collections) == 2
    low = figure.axes[0].collections[0].get_paths()[0].vertices[:, 1].min()
    assert 0 < low < np.abs(lag(1.0)).min()
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["input 1 to output 1", "input 2 to output 1"]


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
def test_the_plants_of_a_model(form):
    s = control.tf("s")
    model = UncertaintyModel(10 / (s + 1), 0.1 * (s + 1) / (s + 10), 0.2 / (s + 1), form=form)
    top, bottom = model.plot().axes
    band = top.collections[0].get_paths()[0].vertices[:, 1]
    assert band.max() > np.abs(top.lines[0].get_ydata()).max()
    assert bottom.get_ylabel() == f"weights, {form}"
    assert [text.get_text() for text in bottom.get_legend().get_texts()] == ["$|W_c|$", "$|W_r|$"]


def test_an_answer_and_its_controller():
    A, C = -np.eye(2), np.vstack([np.eye(2), np.zeros((2, 2)), np.eye(2)])
    B = np.hstack([np.eye(2), np.zeros((2, 2)), np.eye(2)])
    D = np.zeros((6, 6))
    D[2:4, 4:] = D[4:, 2:4] = np.eye(2)
    several = wb.solve(HinfSynthesis(GeneralisedPlant(control.ss(A, B, C, D), None, 2, 2)))
    assert "singular values" in several.answer.plot().axes[0].get_ylabel()

    found = wb.solve(HinfSynthesis(GeneralisedPlant(SCALAR, None, 1, 1)))
    assert found.metrics["norm"] == found.answer.norm
    assert f"norm {found.answer.norm:.6g}" in repr(found)
    top, bottom = found.answer.plot().axes
    assert top.get_ylabel() == "magnitude [1]"
    assert bottom.get_xlabel() == "frequency [Hz]"
    assert found.plot().axes[0].get_ylabel() == "singular values of the closed loop [1]"
    assert found.plot("controller").axes[0].get_ylabel() == "$|K|$"
    with pytest.raises(UnknownNameError, match="no figure is called 'controler'; did you mean"):
        found.plot("controler")


def test_a_figure_shows_itself_in_a_notebook():
    assert wb.solve(SmallestCircle(POINTS)).plot()._repr_png_().startswith(b"\x89PNG")


def test_without_an_answer_there_is_no_figure():
    late = wb.solve(SmallestCircle(POINTS), method="clarabel", options=Options(time_limit=1e-9))
    assert late.answer is None
    assert late.metrics == {}
    with pytest.raises(InputError, match=r"there is no figure of this answer: .*time limit"):
        late.plot()
