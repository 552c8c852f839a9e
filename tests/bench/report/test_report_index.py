"""The index lists every run: by theme, with what tells runs of a problem apart."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import pytest
from html_page import Make, Page, run_pages

import workbench as wb
from workbench import figures
from workbench.bench.report import report
from workbench.bench.report.entries import LONGEST, theme
from workbench.bench.store import seal


@pytest.mark.cases(0)
def test_every_run_has_a_row_that_leads_to_its_page(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a")
    make("lab/stadium", "0000000b", metrics={"radius": 2.5, "points": 12})
    make("lab/overview", "0000000c", method=None, kind="study")
    entry = report(root)
    page = Page(entry)
    anchors = ["lab/circle/0000000a", "lab/overview/0000000c", "lab/stadium/0000000b"]
    assert [row["data-run"] for row in page.rows] == anchors
    ways = [link["href"] for link in page.all("a") if link["href"].startswith("report/")]
    titles = [" ".join(Page(entry.parent / way).text.split()[:3]) for way in ways]
    assert titles == ["lab/circle by exact:", "lab/overview: holds to", "lab/stadium by exact:"]
    head = "".join(page.text[: page.text.index("Certificates are shown as stored")].split())
    assert "runs3hold3donothold0totaltime4.5s" in head
    assert "Runfrom2026-01-0203:04:05UTCto2026-01-0203:04:06UTC." in head
    assert "315.3" in page.text and "study" in page.text


def test_failures_are_shown_as_such(root: Path, make: Make) -> None:
    make(key="0000000a")
    make(key="0000000a", failed=True)
    make(key="0000000b", failed=True, value="nan")
    make(key="0000000c", failed=True)  # whatever its certificate says
    (root / "lab/circle/0000000a.failed/certificate.json").unlink()
    seal(root / "lab/circle/0000000a.failed")
    page = Page(report(root))
    assert {row["data-run"]: row["data-state"] for row in page.rows} == {
        "lab/circle/0000000a": "holds",
        "lab/circle/0000000a.failed": "uncertified",
        "lab/circle/0000000b.failed": "fails",
        "lab/circle/0000000c.failed": "fails",
    }
    assert "runs4hold1donothold3" in "".join(page.text.split())


def test_rows_that_differ_in_parameters_look_different(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a", parameters={"speed": 1.0, "axis": "x", "note": "a" * 99})
    make("lab/circle", "0000000b", parameters={"speed": 2.5, "axis": "x", "note": "b" * 99})
    options = {"tolerance": 1e-8, "time_limit": None, "seed": 0}
    make("lab/stadium", "0000000c", options=options)
    make("lab/stadium", "0000000d")
    make("lab/alone", "0000000e")
    rows = {row["data-run"]: row for row in Page(report(root)).rows}
    shown = {name: json.loads(row.get("data-parameters", "{}")) for name, row in rows.items()}
    assert shown["lab/circle/0000000a"] == {"speed": "1.0", "note": "a" * (LONGEST - 1) + "…"}
    assert shown["lab/circle/0000000b"]["speed"] == "2.5"
    assert shown["lab/stadium/0000000c"] == {"tolerance": "1e-08"}
    assert shown["lab/stadium/0000000d"] == {"tolerance": "1e-06"}
    assert shown["lab/alone/0000000e"] == {}
    assert "axis=x" in rows["lab/circle/0000000a"]["data-words"]  # found all the same


def test_a_missing_or_empty_parameter_is_shown(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a", parameters={"after": ""})
    make("lab/circle", "0000000b", parameters={})
    rows = [json.loads(row["data-parameters"]) for row in Page(report(root)).rows]
    assert rows == [{"after": '""'}, {"after": "–"}]


def test_a_folder_copied_by_hand_is_told_apart(root: Path, make: Make) -> None:
    folder = make("lab/circle")
    copy = folder.with_name("copy")
    copy.mkdir()
    for file in folder.iterdir():
        (copy / file.name).write_bytes(file.read_bytes())
    entry = report(root)
    rows = [json.loads(row.get("data-parameters", "{}")) for row in Page(entry).rows]
    assert rows == [{}, {"folder": "lab/circle/copy"}]
    assert len(run_pages(entry)) == 2


def test_themes_are_the_folders_of_the_sources(project) -> None:
    assert theme("toy/root") == "toy"
    assert theme("elsewhere/x/y") == "elsewhere"
    assert theme("cd/focus/stadiums") == "cd drive: uncertainty"
    assert theme("compare") == "comparisons"
    wb.run("toy/root")
    page = Page(wb.report())
    assert [body["data-theme"] for body in page.all("tbody")] == ["toy"]
    assert wb.problems("toy/root")[0].summary in page.text


def test_a_thumbnail_is_small(root: Path, make: Make, shown: Callable[..., None]) -> None:
    figure, (panel,) = figures.axes(1, 1)
    panel.plot(range(99))
    shown(bode=figure)
    make()
    entry = report(root)
    (small,) = Page(entry).all("img")
    file = entry.parent / small["src"]
    assert file.stat().st_size < 8_000
    assert small["loading"] == "lazy" and small["alt"] == ""
    assert int(small["width"]) <= 120 and int(small["height"]) <= 90


@pytest.mark.slow
def test_two_hundred_runs_stay_below_half_a_megabyte(root: Path, make: Make) -> None:
    for number in range(200):
        make(f"laboratory/{number:03d}/a-problem", f"{number:08x}", parameters={"n": number})
    assert report(root).stat().st_size < 500_000


def test_a_pattern_selects_problems(root: Path, make: Make) -> None:
    make("lab/circle")
    make("lab/stadium")
    page = Page(report(root, pattern="*/circle"))
    assert [row["data-run"] for row in page.rows] == ["lab/circle/0a1b2c3d"]
    assert "Problems that fit */circle" in page.text


def test_an_empty_page_says_what_to_run(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WORKBENCH_RESULTS", str(root))
    page = Page(report())
    assert "no results here yet" in page.text
    assert "workbench run" in page.text
    make("other/circle")
    assert "lab/*" in Page(report(root, pattern="lab/*")).text


def test_a_damaged_folder_is_left_out(root: Path, make: Make) -> None:
    make("lab/circle")
    (make("lab/stadium") / "run.json").write_text("{", encoding="utf-8")
    page = Page(report(root))
    assert [row["data-run"] for row in page.rows] == ["lab/circle/0a1b2c3d"]
    assert "Left out: lab/stadium/0a1b2c3d: run.json was changed" in page.text


def test_links_of_themes_are_addresses(root: Path, make: Make) -> None:
    make("lab a/circle".replace(" ", "-"))
    links = [link for link in Page(report(root)).all("a") if "data-theme" in link]
    assert [unquote(link["href"]) for link in links] == ["#theme=", "#theme=lab-a"]
