"""Figures for a paper: their width, their letters, their files."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.text import Text

import workbench as wb
from workbench import figures
from workbench.errors import InputError, ResultError
from workbench.figures import printed
from workbench.figures.printed import PrintedFigure, tex_program
from workbench.figures.styles import drawn_in, paper_style, settle

POINTS_PER_MM = 72 / 25.4
WIDTHS = {"column": 88.9, "page": 181.9, 120.0: 120.0}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WORKBENCH_RESULTS", str(tmp_path_factory.mktemp("results")))
        yield wb.run("cd/red-book", frequencies=20)


def drawn(width="column", *, title="", size=11.0):
    style = paper_style(width)
    with drawn_in(style):
        figure, panels = figures.axes(2, 2, size=(9.0, 4.0))
        for panel in panels:
            panel.plot([1, 10], [1, 3], label="curve")
            panel.set_title(title, fontsize=size)
        figure.suptitle("what a caption says", fontsize=size)
        return PrintedFigure("mine", figure, style, settle(figure))


@pytest.mark.cases(1)
@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_of_the_pdf_has_the_width_that_was_asked_for(run, width):
    box = re.search(rb"/MediaBox \[([^\]]+)\]", run.figure(width=width).pdf)
    right = float(box[1].split()[2])
    assert right == pytest.approx(WIDTHS[width] * POINTS_PER_MM, abs=0.5)


@pytest.mark.cases(0)
def test_the_same_figure_is_the_same_bytes_with_fonts_that_publishers_take(run):
    first, second = run.figure(), run.figure()
    assert first.pdf == second.pdf and first.svg == second.svg
    assert b"/Type3" not in first.pdf and b"/CIDFontType2" in first.pdf


def test_letters_lines_and_titles_are_those_of_a_paper():
    one = drawn(title="a title that is by far longer than the panel of a column is wide")
    assert one.caption == "what a caption says"
    assert not one.figure.get_suptitle()
    sizes = {text.get_fontsize() for text in one.figure.findobj(Text) if text.get_text()}
    assert max(sizes) <= 8 and min(sizes) >= 6
    assert one.figure.axes[0].lines[0].get_linewidth() == pytest.approx(1.0)
    assert "\n" in one.figure.axes[0].get_title()
    assert one.png.startswith(b"\x89PNG")
    box = one.figure.bbox
    for text in one.figure.findobj(Text):
        if text.get_text() and text.get_visible() and "\n" in text.get_text():
            place = text.get_window_extent()
            assert place.x0 >= box.x0 - 1 and place.x1 <= box.x1 + 1


def test_panels_do_not_get_flat():
    flat = drawn("column")
    assert flat.figure.get_size_inches()[1] >= 2 * 1.2
    assert drawn("page").figure.get_size_inches()[1] == pytest.approx(181.9 / 25.4 * 4 / 9)


def test_a_figure_on_a_screen_is_as_it_was(run):
    before = run.figures["figure-2-12"].get_size_inches()
    run.figure(name="figure-2-12", width="column")
    np.testing.assert_array_equal(run.figures["figure-2-12"].get_size_inches(), before)


def test_vectors_leave_a_figure_its_resolution():
    one = drawn()
    assert one.pdf and one.svg
    assert one.figure.dpi == 300


def test_what_is_no_width_style_or_figure(run):
    for width in ("narrow", 3.5, float("nan")):
        with pytest.raises(InputError, match=r"the width of a figure is"):
            run.figure(width=width)
    with pytest.raises(InputError, match="style 'paper', not 'poster'"):
        run.figure(style="poster")
    with pytest.raises(ResultError, match="no figure 'mu' here; there are figure-2-12"):
        run.figure(name="mu")


@pytest.mark.cases(0)
def test_files_without_latex(run, tmp_path, monkeypatch):
    monkeypatch.setattr(printed, "TEX_PROGRAMS", ("no-such-tex", "nor-this-one"))
    files = run.figure().save(tmp_path / "paper")
    assert [file.name for file in files] == ["figure-2-12.pdf", "figure-2-12.svg"]
    with pytest.raises(ResultError, match="needs LaTeX"):
        run.figure().write_pgf(tmp_path / "figure.pgf")
    files = run.draw(tmp_path / "all", style="paper", width=100.0)
    assert {file.suffix for file in files} == {".pdf", ".svg"} | ({".md"} if run.tables else set())


DOCUMENT = r"""\documentclass{article}
\usepackage{pgf}
\begin{document}\input{mine.pgf}\end{document}
"""


@pytest.mark.slow  # LaTeX starts thrice
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX here")
def test_pgf_goes_into_a_document(tmp_path):
    files = drawn().save(tmp_path)
    assert tex_program() == "pdflatex" and files[2] == tmp_path / "mine.pgf"
    (tmp_path / "paper.tex").write_text(DOCUMENT)
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "paper.pdf").stat().st_size > 1000
