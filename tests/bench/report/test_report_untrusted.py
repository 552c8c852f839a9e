"""Folders that somebody else has made cost their own row at most, and run nothing."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from html_page import Make, Page, run_pages

from workbench.bench.report import report
from workbench.bench.store import seal

HOSTILE = '<script>alert(1)</script>"><img src=x onerror=alert(2)>'


def pages_of(entry: Path) -> list[Page]:
    return [Page(page) for page in [entry, *run_pages(entry)]]


@pytest.mark.cases(0)
def test_pages_load_nothing_from_outside(root: Path, make: Make, make_comparison: Make) -> None:
    make()
    make_comparison()
    for page in pages_of(report(root)):
        for tag, attributes in page.elements:
            assert tag not in ("link", "iframe", "object", "embed", "base")
            for name in ("src", "srcset", "poster", "data", "action", "href"):
                assert "://" not in attributes.get(name, "")
                assert not attributes.get(name, "").startswith("//")
        assert not any("url(" in style or "@import" in style for style in page.raw["style"])
        policy = page.all("meta")[1]["content"]
        assert "default-src 'none'" in policy and "connect-src" not in policy


def test_only_its_own_script_may_run(root: Path, make: Make) -> None:
    make()
    for page in pages_of(report(root)):
        (script,) = ["".join(page.raw["script"])]
        code = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"script-src 'sha256-{code}'" in page.all("meta")[1]["content"]


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
    make(key="0000000b", parameters={HOSTILE: "other"})
    pages = pages_of(report(root))
    assert len(pages) == 3 and len(pages[0].rows) == 2
    for page in pages:
        assert len(page.all("script")) == 1
        assert all("onerror" not in attributes for _, attributes in page.elements)


@pytest.mark.cases(1)
@pytest.mark.parametrize("pattern", [HOSTILE, 5, ["x"], None, {}])
@pytest.mark.parametrize("problems", [HOSTILE, 7, [HOSTILE]])
def test_hostile_parameters_of_a_comparison_are_inert(
    root: Path, make_comparison: Make, pattern: Any, problems: Any
) -> None:
    make_comparison(parameters={"pattern": pattern, "problems": problems}, metrics={})
    for page in pages_of(report(root)):
        assert len(page.all("script")) == 1
        assert "unknown share of unknown number of cells certified" in page.text


@pytest.mark.cases(0)
def test_hostile_tables_and_sentences_that_were_kept_are_text(root: Path, make: Make) -> None:
    make()
    report(root)
    (file,) = (root / "report" / "kept").glob("*.json")
    stored = json.loads(file.read_text(encoding="utf-8"))
    bars = f"| a | {HOSTILE} |\n| --- | --- |\n| {HOSTILE} | 1 |\n| too | many | cells |\n"
    stored |= {"tables": {HOSTILE: bars, "no rule": "| a |\n"}, "missing": [HOSTILE]}
    file.write_text(json.dumps(stored), encoding="utf-8")
    page = pages_of(report(root))[1]
    assert len(page.all("script")) == 1 and HOSTILE in page.text
    assert all("onerror" not in attributes for _, attributes in page.elements)


@pytest.mark.cases(2)
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
    entry = report(root)
    page = Page(entry)
    assert [row["data-run"] for row in page.rows] == ["lab/circle/0000000a"]
    assert "Left out: lab/stadium/0000000b: " in page.text
    assert reason in page.text
    assert len(page.all("script")) == 1 and len(run_pages(entry)) == 1
