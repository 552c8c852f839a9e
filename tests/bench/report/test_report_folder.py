"""The report is a folder of pages that opens from a disk, drawn once and never half."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from html_page import Make, Page, run_pages

from workbench import figures
from workbench.bench.report import failed_runs, kept, report
from workbench.bench.store import Store, seal
from workbench.cli.batch import workers
from workbench.errors import ResultError
from workbench.figures.formats import png

REFERENCE = Path(__file__).parents[3] / "results" / "reference"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a report by its name."""
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and file.name != ".lock"
    }


def line(height: float = 1.0) -> Any:
    figure, (panel,) = figures.axes(1, 1, size=(3.0, 2.0))
    panel.plot([0.0, height])
    return figure


@pytest.mark.cases(0)
def test_the_same_folders_give_the_same_bytes(
    root: Path, make: Make, shown: Callable[..., None], tmp_path: Path
) -> None:
    shown(bode=line(), nyquist=line(2.0))
    make("lab/circle")
    make("lab/stadium", failed=True)
    for name in ("one", "other"):
        report(root, output=tmp_path / name)
    assert contents(tmp_path / "one") == contents(tmp_path / "other")
    before = contents(tmp_path / "one")
    report(root, output=tmp_path / "one")
    assert contents(tmp_path / "one") == before


def drawn_again(root: Path, output: Path) -> int:
    """How many runs a report draws."""
    told: list[tuple[str, int, int]] = []
    report(root, output=output, progress=lambda *one: told.append(one))
    assert {words for words, _, _ in told} == {"runs drawn"}
    return told[-1][2]


@pytest.mark.cases(0)
def test_only_what_has_changed_is_drawn_again(
    root: Path, make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    circle = make("lab/circle", "0000000a")
    make("lab/filter", "0000000b", needs={"cover": "0000000a"})
    make("lab/stadium", "0000000c", needs={"filter": ["0000000b"]})
    make("lab/other", "0000000d")
    output = tmp_path / "pages"
    assert drawn_again(root, output) == 4
    assert drawn_again(root, output) == 0
    (circle / "log.txt").write_text("another run", encoding="utf-8")
    seal(circle)
    assert drawn_again(root, output) == 3  # it, and what stands on it
    monkeypatch.setattr("workbench.bench.report.drawing_code", lambda: "other code")
    assert drawn_again(root, output) == 4
    (output / "report" / "kept").rename(output / "report" / "gone")
    assert drawn_again(root, output) == 4


def test_needs_in_a_circle_end(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a", needs={"other": "0000000b"})
    make("lab/other", "0000000b", needs={"circle": "0000000a"})
    assert len(Page(report(root)).rows) == 2


def test_a_figure_that_is_gone_is_drawn_again(
    root: Path, make: Make, shown: Callable[..., None], tmp_path: Path
) -> None:
    shown(bode=line())
    make()
    report(root, output=tmp_path)
    for figure in (tmp_path / "report" / "figures").iterdir():
        figure.unlink()
    assert drawn_again(root, tmp_path) == 1
    assert len(list((tmp_path / "report" / "figures").iterdir())) == 2


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "spoilt",
    [
        "{",
        "[]",
        '{"stamp": 1}',
        {"figures": [{"name": "x", "png": "../../../secret.png", "svg": None}]},
        {"figures": [{"name": "x", "png": "a" * 24 + ".html", "svg": None}]},
        {"tables": {"x": [1]}},
    ],
)
def test_what_is_kept_is_not_trusted(root: Path, make: Make, spoilt: Any) -> None:
    make()
    report(root)
    (file,) = (root / "report" / "kept").glob("*.json")
    stored = json.loads(file.read_text(encoding="utf-8"))
    if isinstance(spoilt, dict):
        spoilt = json.dumps(stored | spoilt)
    file.write_text(spoilt, encoding="utf-8")
    assert drawn_again(root, root) == 1
    assert json.loads(file.read_text(encoding="utf-8")) == stored


def test_pages_of_runs_that_are_gone_go(
    root: Path, make: Make, shown: Callable[..., None], tmp_path: Path
) -> None:
    shown(bode=line())
    make("lab/circle")
    gone = make("lab/stadium")
    entry = report(root, output=tmp_path / "pages")
    assert len(run_pages(entry)) == 2
    own = entry.parent / "report" / "figures" / "notes.txt"
    own.write_text("mine", encoding="utf-8")
    (entry.parent / "report" / "runs" / ".lab-x.html.123").write_text("left by a killed report")
    for file in gone.iterdir():
        file.unlink()
    gone.rmdir()
    report(root, output=tmp_path / "pages")
    assert [page.name[:11] for page in run_pages(entry)] == ["lab-circle-"]
    assert len(list((entry.parent / "report" / "kept").iterdir())) == 1
    assert own.read_text(encoding="utf-8") == "mine"  # files of others stay
    assert not list((entry.parent / "report" / "runs").glob(".*"))


@pytest.mark.slow
def test_an_interrupted_report_leaves_the_earlier_one(
    root: Path, make: Make, shown: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever it stops, the old entry and all it leads to are there."""
    shown(bode=line())
    make("lab/circle")
    entry = report(root)
    before = entry.read_bytes()
    for stop in range(1, 12):
        shown(bode=line(1.0 + stop))
        make("lab/circle", f"0000000{stop:x}")
        monkeypatch.setattr("workbench.bench.report.drawing_code", lambda stop=stop: f"v{stop}")
        real, count = Path.replace, 0

        def full(self: Path, target: Path, stop: int = stop, real: Any = real) -> Path:
            nonlocal count
            count += 1
            if count == stop or target.name == "index.html":
                raise OSError(28, "No space left on device", "page")
            return real(self, target)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", full)
            with pytest.raises(ResultError, match="No space left on device"):
                report(root)
        assert entry.read_bytes() == before
        for place in [entry, *run_pages(entry)]:
            page = Page(place)
            for way in [link["href"] for link in page.all("a")] + [
                i["src"] for i in page.all("img")
            ]:
                file = way.partition("#")[0]
                assert not file or (place.parent / file).exists(), (stop, place, way)
    report(root)
    assert len(Page(entry).rows) == 12


def test_no_results_folder_is_mistaken_for_a_page(root: Path, make: Make) -> None:
    folder = make()
    report(root)
    assert Store(root).folders() == [folder]


# --- where it is written ----------------------------------------------------------------------


@pytest.mark.parametrize("typo", ["missing", "file", "empty"])
def test_a_typo_creates_nothing(tmp_path: Path, typo: str) -> None:
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultError, match="a results folder is needed"):
        report(tmp_path / typo)
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["empty", "file"]


def test_a_page_of_others_is_not_replaced(root: Path, make: Make, tmp_path: Path) -> None:
    make()
    (tmp_path / "index.html").write_text("<title>My home page</title>", encoding="utf-8")
    with pytest.raises(ResultError, match=r"no report has written it"):
        report(root, output=tmp_path)
    assert not (tmp_path / "report").exists()
    old = "<!DOCTYPE html><title>Workbench results</title>"
    (tmp_path / "index.html").write_text(old, encoding="utf-8")
    assert Page(report(root, output=tmp_path)).rows


def test_a_report_is_not_written_through_links(root: Path, make: Make, tmp_path: Path) -> None:
    make()
    (tmp_path / "elsewhere").mkdir()
    (root / "report").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ResultError, match="is a link"):
        report(root)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_sealed_folder_is_not_written_into(root: Path, make: Make) -> None:
    folder = make()
    with pytest.raises(ResultError, match="another place"):
        report(root, output=folder)


def test_a_place_that_cannot_be_written_is_named(root: Path, make: Make, tmp_path: Path) -> None:
    make()
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResultError, match=r"cannot write the report in .*file"):
        report(root, output=tmp_path / "file")


def test_the_default_root_is_the_projects(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    monkeypatch.setenv("WORKBENCH_RESULTS", str(root))
    assert report() == root / "index.html"


# --- figures ----------------------------------------------------------------------------------


def test_figures_are_files_that_load_when_they_are_looked_at(
    root: Path, make: Make, shown: Callable[..., None]
) -> None:
    make()
    figure = line()
    shown(**{"figure-7-13": figure})
    (place,) = run_pages(report(root))
    (attributes,) = Page(place).all("img")
    assert (place.parent / attributes["src"]).read_bytes() == png(figure)
    assert attributes["alt"] == "figure 7.13: figure of lab/circle by exact"
    assert (attributes["width"], attributes["height"]) == ("360", "240")
    assert attributes["loading"] == "lazy"


def test_a_figure_that_fails_is_named_and_the_others_are_drawn(
    root: Path, make: Make, shown: Callable[..., None]
) -> None:
    make()
    unreadable, (panel,) = figures.axes(1, 1)
    panel.set_xlabel(r"$\frac{$")
    broken = ValueError("no such line")
    shown(step_response=broken, bode=figures.axes(1, 1)[0], nyquist=unreadable)
    page = Page(run_pages(report(root))[0])
    assert [one["alt"].partition(":")[0] for one in page.all("img")] == ["bode"]
    assert "Figure not drawn: step response: ValueError: no such line" in page.text
    assert "Figure not drawn: nyquist: ValueError" in page.text


def test_failures_and_runs_being_written_are_found(root: Path, make: Make) -> None:
    make(key="0000000b", failed=True)
    make(".partial/lab", failed=True)
    make("reference/lab", failed=True)
    assert [run.path.name for run in failed_runs(root)] == ["0000000b.failed"]
    assert failed_runs(root, "other*") == []


@pytest.mark.slow
def test_several_processes_make_the_same_report(tmp_path: Path) -> None:
    for jobs in (1, 2):
        with workers(jobs) as executor:
            report(
                root=REFERENCE,
                output=tmp_path / str(jobs),
                pattern="cd/*/linearity",
                executor=executor,
            )
    one, two = contents(tmp_path / "1"), contents(tmp_path / "2")
    assert one == two and sum(name.endswith(".png") for name in one) >= 2
    assert kept.ENTRY in one
