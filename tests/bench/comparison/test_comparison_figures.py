"""Figures of comparisons: what they draw, that nothing is cut off, and that methods can be told."""

import io
import re

import numpy as np
import pytest
from made_cells import LEVELS, heuristic, inaccurate, invalid, made, nothing, solved, synthetic

from workbench.bench.comparison import judged_cells
from workbench.bench.comparison.layout import NUMBERS, seconds
from workbench.bench.comparison.profiles import performance_ratios, profile
from workbench.bench.comparison.study import drawings
from workbench.bench.comparison.styles import method_looks
from workbench.bench.report.points import every_cell

NONE = 100.0
"""Height of cells without a gap, two decades above the power of ten that bounds every gap."""
ALL = {"performance-profile", "cactus", "scaling", "accuracy-against-time", "agreement"}


@pytest.fixture(scope="module")
def many():
    """Figures of twelve methods."""
    return drawings(judged_cells(synthetic(problems=7, methods=12, repetitions=2)))


@pytest.mark.cases(0)
def test_there_is_a_figure_of_every_kind(many):
    assert many.keys() == ALL


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", sorted(ALL))
def test_nothing_is_cut_off_and_every_axis_is_labelled(many, name):
    figure = many[name]
    figure.draw_without_rendering()
    box = figure.get_tightbbox().transformed(figure.dpi_scale_trans)
    width, height = figure.canvas.get_width_height()
    assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert shown[0].get_xlabel() and shown[0].get_ylabel()


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", sorted(ALL - {"agreement"}))
def test_the_legend_names_every_method_and_covers_no_data(many, name):
    (legend,) = many[name].legends
    assert {text.get_text() for text in legend.get_texts()} >= {f"method-{k}" for k in range(12)}
    many[name].draw_without_rendering()
    top = legend.get_window_extent().y1
    assert all(axes.get_window_extent().y0 >= top for axes in many[name].axes)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", sorted(ALL))
def test_a_page_can_find_what_is_drawn_for_a_method(many, name):
    text = io.StringIO()
    many[name].savefig(text, format="svg")
    found = set(re.findall(r'id="method:([^"]+)"', text.getvalue()))
    assert found == {f"method-{k}" for k in range(12)}


def test_twelve_methods_all_look_different():
    found = method_looks(synthetic(problems=1, methods=12, repetitions=1)).values()
    assert len({(look.colour, look.marker) for look in found}) == 12
    assert len({(look.colour, look.line) for look in found}) == 12


# --- the numbers drawn --------------------------------------------------------------------------


def timed(**seconds):
    """One problem for each time of a method; None is a failure."""
    cells = {}
    for method, times in seconds.items():
        for i, time in enumerate(times):
            cell = nothing("failed") if time is None else solved(solve=time, statement=0.0)
            cells[f"p{i}", method] = cell
    return judged_cells(made(cells, sizes={"p0": 1.0, "p1": 2.0, "p2": 4.0}))


def test_a_profile_by_hand():
    """Dolan and More's definition on three problems."""
    ratios = performance_ratios(timed(a=[1.0, 4.0, 2.0], b=[2.0, 1.0, None]))[:, :, 0]
    assert ratios.T.tolist() == [[1.0, 4.0, 1.0], [2.0, 1.0, np.inf]]
    tau, share = profile(ratios[:, 0])
    assert tau.tolist() == [1.0, 4.0] and share.tolist() == pytest.approx([2 / 3, 1.0])
    tau, share = profile(ratios[:, 1])
    assert tau.tolist() == [1.0, 2.0] and share.tolist() == pytest.approx([1 / 3, 2 / 3])


def test_the_curves_of_profile_and_cactus_have_the_steps_of_the_times():
    figures = drawings(timed(a=[1.0, 4.0, 2.0], b=[2.0, 1.0, None]))
    a, b = figures["cactus"].axes[0].get_lines()
    assert a.get_xdata()[:-1].tolist() == [1.0, 2.0, 4.0]
    assert a.get_ydata().tolist() == [1, 2, 3, 3] and b.get_ydata().tolist() == [1, 2, 2]
    assert a.get_xdata()[-1] == b.get_xdata()[-1] > 4.0  # both go on to the right end
    a, b = figures["performance-profile"].axes[0].get_lines()
    assert b.get_ydata().tolist() == pytest.approx([1 / 3, 2 / 3, 2 / 3])


@pytest.mark.cases(0)
def test_the_time_over_the_size_is_that_of_each_problem():
    panel = drawings(timed(a=[1.0, 4.0, 2.0]))["scaling"].axes[0]
    points, _ = panel.get_lines()
    assert points.get_xdata().tolist() == [1.0, 2.0, 4.0]
    assert points.get_ydata().tolist() == [1.0, 4.0, 2.0]
    assert panel.get_xscale() == panel.get_yscale() == "log"


def points(figure):
    """Gaps drawn, by method and marker face; crosses apart."""
    return [
        (line.get_gid(), float(line.get_ydata()[0]), line.get_markerfacecolor())
        for line in figure.axes[0].get_lines()
        if line.get_gid() and line.get_marker() != "None"
    ]


def test_an_answer_far_below_its_bound_does_not_look_exact():
    cells = {("p", "bad"): inaccurate(0.02, -0.98, scale=1.0), ("p", "good"): solved(1.0, 0.0)}
    cells |= {("p", "open"): inaccurate(1.0, np.inf), ("p", "none"): invalid()}  # without a time
    figure = drawings(judged_cells(made(cells)))["accuracy-against-time"]
    drawn = points(figure)
    assert [(name, gap) for name, gap, _ in drawn] == [
        ("method:bad", -0.98), ("method:bad", -0.98), ("method:good", 0.0), ("method:open", NONE),
    ]  # fmt: skip
    faces = {name: face for name, _, face in drawn}
    assert faces["method:open"] == "none" and faces["method:good"] != "none"
    panel = figure.axes[0]
    heights = [panel.transData.transform((0.1, gap))[1] for gap in (-0.98, 0.0, NONE)]
    low, high = panel.get_window_extent().y0, panel.get_window_extent().y1
    assert low < heights[0] < heights[1] < heights[2] < high
    assert heights[1] - heights[0] > 0.3 * (high - low)  # far from an exact answer
    assert panel.get_yscale() == "symlog"
    assert panel.get_yticklabels()[-1].get_text() == "none"


def test_the_axis_has_negative_gaps_only_where_there_are_some():
    figure = drawings(judged_cells(made({("p", "a"): solved(1.0, 1e-8), ("p", "b"): solved()})))
    panel = figure["accuracy-against-time"].axes[0]
    low, high = panel.transAxes.inverted().transform(panel.transData.transform([[1, 0], [1, 1e-8]]))
    assert low[1] < 0.2 < high[1] < 1
    assert "none" not in [each.get_text() for each in panel.get_yticklabels()]


def test_methods_of_a_program_differ_in_colour():
    cells = {("p", f"first {k}"): solved() for k in range(7)}
    cells |= {("q", name): solved() for name in ("first 0", "other")}
    looks = method_looks(judged_cells(made(cells, programs={"p": "P", "q": "Q"})))
    assert len({looks[f"first {k}"].colour for k in range(7)}) == 7
    assert looks["other"].colour != looks["first 0"].colour


def test_a_wrong_claim_is_crossed():
    cells = {("p", "bad"): inaccurate(2.0, 0.5), ("p", "good"): solved()}
    figure = drawings(judged_cells(made(cells)))["accuracy-against-time"]
    crosses = [line for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
    assert [line.get_gid() for line in crosses] == ["method:bad"]


def test_many_problems_share_a_panel():
    cells = {(f"p{k}", "a"): solved() for k in range(9)}
    figure = drawings(judged_cells(made(cells, LEVELS)))["accuracy-against-time"]
    assert [panel.get_title() for panel in figure.axes] == ["9 problems"]


@pytest.mark.parametrize(
    ("cells", "names"),
    [
        ({("p", "a"): nothing("crashed")}, set()),
        ({("p", "a"): nothing("unfit")}, set()),
        ({("p", "a"): heuristic(np.nan)}, {"performance-profile", "cactus"}),
        ({("p", "a"): invalid() | {"gap": 0.5}}, {"accuracy-against-time"}),
        (
            {("p", "a"): heuristic(), ("p", "b"): heuristic()},
            {"performance-profile", "cactus", "agreement"},
        ),
    ],
)
def test_there_is_no_figure_of_what_there_is_not(cells, names):
    assert drawings(judged_cells(made(cells))).keys() == names


def test_every_program_has_figures_of_its_own():
    cells = {("p", "a"): solved(), ("q", "b"): solved(), ("q", "c"): nothing("failed")}
    programs = {"p": "SmallestCircle", "q": "MuUpperBound"}
    found = drawings(judged_cells(made(cells, programs=programs)))
    names = [f"accuracy-against-time-{one}" for one in ("smallest-circle", "mu-upper-bound")]
    assert set(names) <= found.keys()
    labels = [text.get_text() for text in found[names[0]].legends[0].get_texts()]
    assert "a" in labels and not {"b", "c"} & set(labels)


def test_of_one_problem_the_profiles_would_say_nothing_more():
    assert "cactus" not in drawings(judged_cells(made({("p", "a"): solved()})))
    assert "cactus" in drawings(judged_cells(made({("p", "a"): solved(), ("q", "a"): solved()})))


# --- numbers that are none ----------------------------------------------------------------------


@pytest.mark.cases(0)
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_every_figure_is_drawn_whatever_its_numbers_are(value):
    """In one cell of every variable, then in all cells of the gap and of the times."""
    data = judged_cells(synthetic(problems=2, methods=2, repetitions=1))
    spoilt = data.copy(deep=True)
    for place, name in enumerate(NUMBERS):
        spoilt[name].values.flat[place] = value
    everywhere = data.copy(deep=True)
    for name in ("gap", "solve", "objective", "size"):
        everywhere[name].values[...] = value
    for one in (spoilt, everywhere):
        every_cell(one) if np.isfinite(seconds(one)).any() else None
        for figure in drawings(one).values():
            figure.draw_without_rendering()
