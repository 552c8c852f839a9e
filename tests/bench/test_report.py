"""The report is one page, complete in itself, of every run there is."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from workbench import figures
from workbench.batch import workers
from workbench.bench.files import png
from workbench.bench.report import failed_runs, report
from workbench.bench.report.words import number, pathless, tables_as_html
from workbench.bench.results import Run
from workbench.bench.store import seal
from workbench.errors import ResultError
from workbench.study import Study

HOSTILE = '<script>alert(1)</script>"><img src=x onerror=alert(2)>'

Make = Callable[..., Path]


class Page(HTMLParser):
    """The elements of a page and its text, scripts and styles apart."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self.raw: dict[str, list[str]] = {"script": [], "style": []}
        self._in = ""
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self._in = tag

    def handle_data(self, data: str) -> None:
        if self._in in self.raw:
            self.raw[self._in].append(data)
        else:
            self.text += data

    def handle_endtag(self, tag: str) -> None:
        self._in = ""

    def all(self, tag: str, cls: str = "") -> list[dict[str, str]]:
        return [
            attributes
            for name, attributes in self.elements
            if name == tag and cls in ["", *attributes.get("class", "").split()]
        ]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "results"


@pytest.fixture
def make(root: Path) -> Make:
    """Writes a results folder."""

    def write(problem: str = "lab/circle", key: str = "0a1b2c3d", **info: Any) -> Path:
        failed = info.pop("failed", False)
        value, metrics = info.pop("value", 0.0), info.pop("metrics", {"radius": 315.28555396})
        folder = root / problem.replace("<", "(") / (key + ".failed" if failed else key)
        folder.mkdir(parents=True)
        content = {
            "format": 2,
            "problem": problem,
            "parameters": {"frequencies": 400, "angle": None},
            "data": {"data/drives.csv": "c" * 64},
            "needs": {},
            "method": "exact",
            "options": {"tolerance": 1e-06, "time_limit": None, "seed": 0},
            "key": key,
            "kind": "program",
            "headline": "radius",
            "claim": "solved",
            "outcome": "failed" if failed else "solved",
            "message": "",
            "started": "2026-01-02T03:04:05+00:00",
            "finished": "2026-01-02T03:04:06+00:00",
            "seconds": {"statement": 0.0, "solve": 0.25, "check": 0.5, "total": 1.5},
            "code": "07f22203e4ca2a17",
            "versions": {"workbench": "0.1.0", "numpy": "2.4.6"},
            "platform": "Linux x86_64",
        } | info
        check = {"name": "containment", "statement": "distance of a point beyond its circle"}
        check |= {"value": value, "limit": 1e-09, "where": "at 5 Hz", "holds": not failed}
        gap = {"statement": "radius above its bound", "value": 2e-8, "tolerance": 1e-6}
        certificate = {"checks": [check], "gap": gap | {"required": True, "closed": True}}
        for name, stored in ("run", content), ("certificate", certificate), ("metrics", metrics):
            (folder / f"{name}.json").write_text(json.dumps(stored), encoding="utf-8")
        (folder / "log.txt").write_text("outcome: solved.\n", encoding="utf-8")
        seal(folder)
        return folder

    return write


def image(page: Page) -> tuple[str, bytes]:
    """Kind and content of the page's first figure."""
    kind, _, code = page.all("img")[0]["src"].partition(";base64,")
    return kind, base64.b64decode(code)


# --- what is on the page ----------------------------------------------------------------------


def test_every_run_is_in_the_table_and_has_a_section(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a")
    make("lab/stadium", "0000000b", metrics={"radius": 2.5, "points": 12})
    make("lab/overview", "0000000c", method=None, kind="study")
    page = Page(report(root))

    anchors = ["lab/circle/0000000a", "lab/overview/0000000c", "lab/stadium/0000000b"]
    assert [row["data-run"] for row in page.all("tr") if "data-run" in row] == anchors
    assert [section["id"] for section in page.all("details", "run")] == anchors
    assert {f"#{anchor}" for anchor in anchors} <= {link["href"] for link in page.all("a")}
    assert "problem 'lab/circle' is not registered here" in page.text
    for words in (
        "315.286",  # metrics
        "distance of a point beyond its circle",  # certificate
        "radius above its bound",
        "study",
        "07f22203e4ca2a17",  # provenance
        "c" * 64,
        "2026-01-02 03:04:05 UTC",
        "outcome: solved.",  # log
        "lab/stadium/0000000b",
    ):
        assert words in page.text
    head = page.text[: page.text.index("Certificates are shown as stored")]
    head = "".join(head.split())
    assert "runs3hold3donothold0totaltime4.5s" in head
    assert "Runfrom2026-01-0203:04:05UTCto2026-01-0203:04:06UTC." in head


def test_failures_are_shown_as_such(root: Path, make: Make) -> None:
    make(key="0000000a")
    folder = make(
        key="0000000a", failed=True, message="LinAlgError: singular in /home/me/lab/problems/x.py"
    )
    for name in ("certificate.json", "metrics.json", "log.txt"):
        (folder / name).unlink()
    seal(folder)
    make(key="0000000b", failed=True, value="nan")
    assert [run.path.name for run in failed_runs(root)] == ["0000000a.failed", "0000000b.failed"]
    assert failed_runs(root, "other*") == []

    page = Page(report(root))
    states = {row["data-run"]: row["data-state"] for row in page.all("tr") if "data-run" in row}
    assert states == {
        "lab/circle/0000000a": "holds",
        "lab/circle/0000000a.failed": "uncertified",
        "lab/circle/0000000b.failed": "fails",
    }
    assert page.text.count("kept as a failure") == 2
    assert "singular in …/problems/x.py" in page.text
    assert "NaN" in page.text


def test_runs_being_written_and_reference_results_are_left_out(root: Path, make: Make) -> None:
    make(".partial/lab", failed=True)
    make("reference/lab", failed=True)
    make("reference/lab")
    assert failed_runs(root) == []
    assert not Page(report(root)).all("details")


def test_needs_lead_to_their_runs(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a")
    make("lab/filter", "0000000b", needs={"cover": "0000000a", "drives": ["0000000a", "ffffffff"]})
    page = Page(report(root))
    links = [link["href"] for link in page.all("a")]
    assert links.count("#lab/circle/0000000a") == 2 + 2  # its row and section, and two needs
    assert "ffffffff" in page.text


def test_a_pattern_selects_problems(root: Path, make: Make) -> None:
    make("lab/circle")
    make("lab/stadium")
    page = Page(report(root, pattern="*/circle"))
    assert [section["id"] for section in page.all("details")] == ["lab/circle/0a1b2c3d"]


def test_an_empty_page_says_what_to_run(root: Path) -> None:
    page = Page(report(root))
    assert "no results here yet" in page.text
    assert "workbench run" in page.text
    assert "lab/*" in Page(report(root, pattern="lab/*")).text


# --- what kind of page it is ------------------------------------------------------------------


def test_the_page_needs_nothing_else(root: Path, make: Make) -> None:
    make()
    page = Page(report(root))
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "srcset", "poster", "data", "action"):
            assert attributes.get(name, "data:").startswith("data:"), (tag, attributes)
        if tag not in ("a", "use"):  # a link loads nothing, and these lead nowhere outside
            assert "href" not in attributes
        assert "://" not in attributes.get("href", "")
    assert not any("url(" in style or "@import" in style for style in page.raw["style"])
    assert "default-src 'none'" in page.all("meta")[1]["content"]


class Drawn(Study):
    """Draws figures by name; an error in place of a figure is raised."""

    def __init__(self, **drawn: Any) -> None:
        self.drawn = drawn

    def drawings(self, answer: Any) -> dict[str, Callable[[], dict[str, Any]]]:
        return {name: partial(self._draw, name) for name in self.drawn}

    def _draw(self, name: str) -> dict[str, Any]:
        if isinstance(self.drawn[name], Exception):
            raise self.drawn[name]
        return {name: self.drawn[name]}


def shown(monkeypatch: pytest.MonkeyPatch, **drawn: Any) -> None:
    """Let every run have these figures."""
    monkeypatch.setattr(Run, "task", Drawn(**drawn))
    monkeypatch.setattr(Run, "answer", None)
    monkeypatch.setattr(Run, "tables", {})


def test_a_figure_is_embedded_as_pixels(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    figure, (panel,) = figures.axes(size=(3.0, 2.0))
    panel.plot([0.0, 1.0])
    shown(monkeypatch, **{"figure-7-13": figure})
    page = Page(report(root))
    kind, content = image(page)
    assert kind == "data:image/png" and content == png(figure)
    attributes = page.all("img")[0]
    assert attributes["alt"] == "figure 7.13: figure of lab/circle by exact"
    assert (attributes["width"], attributes["height"]) == ("360", "240")


def test_a_figure_that_fails_is_named_and_the_others_are_drawn(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    unreadable, (panel,) = figures.axes()
    panel.set_xlabel(r"$\frac{$")
    broken = ValueError("no such line")
    shown(monkeypatch, step_response=broken, bode=figures.axes()[0], nyquist=unreadable)
    page = Page(report(root))
    assert [one["alt"].partition(":")[0] for one in page.all("img")] == ["bode"]
    assert "Figure not drawn: step response: ValueError: no such line" in page.text
    assert "Figure not drawn: nyquist: ValueError" in page.text


def test_progress_tells_how_many_runs_are_drawn(root: Path, make: Make) -> None:
    make("lab/circle")
    make("lab/stadium")
    told: list[tuple[str, int, int]] = []
    report(root, progress=lambda *one: told.append(one))
    assert told == [("runs drawn", done, 2) for done in range(3)]


@pytest.mark.slow
def test_several_processes_make_the_same_page(tmp_path: Path) -> None:
    stored = Path(__file__).parents[2] / "results" / "reference"
    pages = [tmp_path / f"{jobs}.html" for jobs in (1, 2)]
    for jobs, page in enumerate(pages, start=1):
        with workers(jobs) as executor:
            report(stored, page, "cd/*/linearity", executor=executor)
    assert len(Page(pages[0]).all("img")) == 2
    assert pages[0].read_bytes() == pages[1].read_bytes()


def test_hostile_words_are_inert(root: Path, make: Make) -> None:
    make(
        method=HOSTILE,
        message=HOSTILE,
        platform=HOSTILE,
        headline=HOSTILE,
        metrics={HOSTILE: 1.0},
        parameters={HOSTILE: HOSTILE},
        versions={HOSTILE: HOSTILE},
        needs={HOSTILE: ["0a1b2c3d"]},
        kind=HOSTILE,
        code=HOSTILE,
    )
    page = Page(report(root))
    assert page.all("details", "run")
    assert len(page.all("script")) == 1
    assert all("onerror" not in attributes for _, attributes in page.elements)


@pytest.mark.parametrize(
    ("info", "reason"),
    [
        ({"problem": f"lab/{HOSTILE}"}, "is no name of a problem"),
        ({"problem": "../../elsewhere"}, "is no name of a problem"),
        ({"key": "../0a1b2c3d"}, "is no key"),
        ({"needs": {"cover": "../../x"}}, "is no key"),
        ({"format": 99}, "format 99, of a newer workbench"),
        ({"outcome": HOSTILE}, "outcome"),
        ({"started": "yesterday"}, "started"),
        ({"seconds": {"total": "much"}}, "seconds.total"),
        ({"seconds": {}}, "there is no total"),
        ({"parameters": []}, "parameters"),
        ({"metrics": {"radius": []}}, "metrics.json holds no metrics"),
        ({"value": [1.0]}, "certificate.json holds no certificate"),
    ],
)
def test_a_bad_folder_costs_its_row_only(
    root: Path, make: Make, info: dict[str, Any], reason: str
) -> None:
    make("lab/circle", "0000000a")
    folder = make("lab/stadium", "0000000b")
    content = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    for name in info.keys() & {"metrics"}:
        (folder / f"{name}.json").write_text(json.dumps(info[name]), encoding="utf-8")
    if "value" in info:
        stored = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
        stored["checks"][0] |= info
        (folder / "certificate.json").write_text(json.dumps(stored), encoding="utf-8")
    (folder / "run.json").write_text(json.dumps(content | info), encoding="utf-8")
    seal(folder)
    page = Page(report(root))
    assert [row["data-run"] for row in page.all("tr") if "data-run" in row] == [
        "lab/circle/0000000a"
    ]
    assert "Left out: lab/stadium/0000000b: " in page.text
    assert reason in page.text
    assert len(page.all("script")) == 1


def test_only_its_own_script_may_run(root: Path, make: Make) -> None:
    make()
    page = Page(report(root))
    code = base64.b64encode(hashlib.sha256("".join(page.raw["script"]).encode()).digest()).decode()
    assert f"script-src 'sha256-{code}'" in page.all("meta")[1]["content"]


def test_links_are_relative_and_lead_there(root: Path, make: Make, tmp_path: Path) -> None:
    folder = make()
    for target in (None, tmp_path / "pages" / "a b.html"):
        page = report(root, target)
        hrefs = [link["href"] for link in Page(page).all("a") if link["href"][0] != "#"]
        assert len(hrefs) == 1
        found = [(page.parent / unquote(href)).resolve() for href in hrefs]
        assert folder.resolve() in found
        assert all(place.exists() for place in found)
        assert str(tmp_path) not in page.read_text(encoding="utf-8")


def test_the_same_folders_give_the_same_page(root: Path, make: Make) -> None:
    make("lab/circle")
    make("lab/stadium", failed=True)
    first = report(root).read_bytes()
    assert report(root).read_bytes() == first


def test_the_page_appears_whole_or_not_at_all(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    page = report(root)
    before = page.read_bytes()
    make("lab/stadium")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "page")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(ResultError, match="No space left on device"):
        report(root)
    assert page.read_bytes() == before
    assert sorted(file.name for file in root.iterdir()) == ["index.html", "lab"]


def test_a_damaged_folder_is_left_out(root: Path, make: Make) -> None:
    make("lab/circle")
    (make("lab/stadium") / "run.json").write_text("{", encoding="utf-8")
    page = Page(report(root))
    assert [row["data-run"] for row in page.all("tr") if "data-run" in row] == [
        "lab/circle/0a1b2c3d"
    ]
    assert "Left out: lab/stadium/0a1b2c3d: run.json was changed" in page.text


def test_a_sealed_folder_is_not_written_into(make: Make) -> None:
    with pytest.raises(ResultError, match="another target"):
        report(make())


def test_a_target_that_cannot_be_written_is_named(root: Path, make: Make, tmp_path: Path) -> None:
    make()
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResultError, match=r"cannot write the page .*page\.html"):
        report(root, tmp_path / "file" / "page.html")


def test_the_default_root_is_the_projects(
    root: Path, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    make()
    monkeypatch.setenv("WORKBENCH_RESULTS", str(root))
    assert report() == root / "index.html"


# --- words and numbers ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (315.28555396, ">315.286<"),
        (-1.5e-9, ">−1.5×10<sup>−9</sup><"),
        (2e20, ">2×10<sup>20</sup><"),
        ("nan", ">NaN<"),
        ("-inf", ">−∞<"),
    ],
)
def test_numbers_are_set(value: Any, shown: str) -> None:
    assert shown in number(value)


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ('File "/home/me/my lab/workbench/program.py"', 'File "…/workbench/program.py"'),
        ("/opt/lib/python3.11/site-packages/scipy/a.py", "…/scipy/a.py"),
        ("C:\\Users\\me\\x.csv and file:///home/me/x.csv", "…/x.csv and file://…/x.csv"),
        ("lab/circle, 3 / 4 m/s, https://a.b/c/d, ../x/y", None),
    ],
)
def test_machine_paths_are_cut(words: str, shown: str | None) -> None:
    assert pathless(words) == (shown or words)


def test_tables_are_shown_as_tables():
    html = tables_as_html("| a | b |\n| --- | ---: |\n| <i> | 2 |\n\nUnfit: x & y\n")
    assert "<td>&lt;i&gt;</td>" in html
    assert '<td class="num">2</td>' in html
    assert "<p>Unfit: x &amp; y</p>" in html
