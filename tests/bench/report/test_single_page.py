"""One run as one page, and the command that writes pages."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from html_page import Make, Page

import workbench as wb
from workbench import figures
from workbench.bench.report import single_page
from workbench.cli import main
from workbench.errors import ResultError
from workbench.figures.formats import png


def test_the_figures_are_inside(make: Make, shown: Callable[..., None], tmp_path: Path) -> None:
    figure, (panel,) = figures.axes(1, 1, size=(3.0, 2.0))
    panel.plot([0.0, 1.0])
    shown(bode=figure)
    place = single_page(make(), tmp_path / "pages" / "one.html")
    page = Page(place)
    kind, _, code = page.all("img")[0]["src"].partition(";base64,")
    assert kind == "data:image/png" and base64.b64decode(code) == png(figure)
    assert not [link for link in page.all("a") if not link["href"].startswith("#")]
    assert "lab/circle/0a1b2c3d" in page.text
    before = place.read_bytes()
    assert place.read_bytes() == before
    assert [file.name for file in place.parent.iterdir()] == ["one.html"]


def test_a_comparison_is_inside_with_its_toggles(make_comparison: Make, tmp_path: Path) -> None:
    page = Page(single_page(make_comparison(), tmp_path / "one.html"))
    assert len([one for one in page.all("button") if "data-toggle" in one]) == 10
    assert len(page.all("template")) == 1


def test_a_damaged_folder_or_none_is_refused(make: Make, tmp_path: Path) -> None:
    folder = make()
    (folder / "log.txt").write_text("changed", encoding="utf-8")
    target = tmp_path / "one.html"
    with pytest.raises(ResultError, match=r"log\.txt was changed"):
        single_page(folder, target)
    with pytest.raises(ResultError, match="is no results folder"):
        single_page(tmp_path / "typo", target)
    with pytest.raises(ResultError, match="would lie in a sealed results folder"):
        single_page(make(key="0000000b"), folder / "one.html")
    with pytest.raises(ResultError, match=r"is a folder; the name of a page is needed"):
        single_page(make(key="0000000c"), tmp_path)
    assert not target.exists()


# --- the command ------------------------------------------------------------------------------


def command(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, ["report", *words])
    return done.exit_code, done.output


@pytest.mark.cases(0)
def test_the_command_writes_a_folder_or_one_page(project) -> None:
    run = wb.run("toy/root")
    code, said = command("--jobs", "1")
    entry = Path("results/index.html")
    assert code == 0 and said.strip().endswith(str(entry))
    assert len(Page(entry).rows) == 1
    code, said = command("--single-file", str(run.path))
    name = f"toy-root-{run.key}.html"
    assert code == 0 and said.strip() == name
    assert "toy/root" in Page(Path(name)).text
    code, said = command("results", "--output", "pages", "--jobs", "1")
    assert code == 0 and Path("pages/index.html").exists() and Path("pages/report/runs").exists()


@pytest.mark.parametrize(
    "words",
    [
        ("typo",),
        ("plants",),
        ("--single-file", "typo"),
        ("--single-file", "results"),
        ("results", "--single-file", "typo"),
        ("typo", "--output", "pages"),
        ("--jobs", "0"),
    ],
)
def test_a_typo_creates_nothing_and_ends_with_2(project, words: tuple[str, ...]) -> None:
    wb.run("toy/root")
    before = sorted(Path().rglob("*"))
    code, said = command(*words)
    assert code == 2 and said.strip()
    assert sorted(Path().rglob("*")) == before
