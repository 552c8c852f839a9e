"""The pages about the thesis are those of the committed results."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest
from workbench.plants.cd_drive.claims import summaries
from workbench.plants.cd_drive.claims.chapters import items

import workbench as wb
from workbench.bench.project import registry
from workbench.cli.group import settings_of

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def pages():
    spec = importlib.util.spec_from_file_location("thesis", ROOT / "docs" / "thesis.py")
    thesis = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(thesis)
    return thesis.pages()


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["thesis.md", "thesis-numbers.md"])
def test_the_pages_are_made_of_the_reference_result(pages, name):
    made = f"run `make thesis`: docs/{name} is not the page of results/reference"
    assert (ROOT / "docs" / name).read_text(encoding="utf-8") == pages[name], made


def test_the_page_leads_with_verdicts_and_ten_findings(pages):
    head = pages["thesis.md"].split("## Chapter 1")[0]
    assert len(re.findall(r"^\d+\. ", head, re.MULTILINE)) == 10
    assert "built in" in head and "not explained by the model" in head


def sections(page):
    """The text below each heading of the page of numbers, by the anchor of the heading."""
    parts = re.split(r"^#+ (.*)$", page, flags=re.MULTILINE)[1:]
    anchors = [title.lower().replace(" ", "-") for title in parts[::2]]
    assert len(set(anchors)) == len(anchors)
    return dict(zip(anchors, parts[1::2], strict=True))


def test_each_row_links_to_the_numbers_of_its_item(pages):
    below = sections(pages["thesis-numbers.md"])
    rows = re.findall(
        r"^\| \[.*\]\(thesis-numbers\.md#(.*?)\) *\|(.*)$", pages["thesis.md"], re.MULTILINE
    )
    for (anchor, row), (_, item) in zip(rows, items(), strict=True):
        place, says, *_, verdict = (cell.strip() for cell in row.strip("| ").split(" | "))
        assert (place, says) == (item.place, item.says)
        assert below[anchor].strip().startswith(f"{place}: {says}. Verdict: **{verdict}**.")
        for number in item.numbers:
            assert number.what in below[anchor] and f"workbench run {number.run} " in below[
                anchor
            ].replace("`", " ")


def test_every_link_between_the_pages_leads_to_a_heading(pages):
    anchors = {name: sections(page) for name, page in pages.items()}
    for page in pages.values():
        for name, anchor in re.findall(r"\]\((thesis[a-z-]*\.md)#([^)]*)\)", page):
            assert anchor in anchors[name], f"{name}#{anchor}"


def test_the_commands_make_the_runs_of_the_keys(pages):
    """By their parameters: those of the stored run, or of the row of the table of summaries."""
    told = set(
        re.findall(
            r"^\| `workbench (run .*?)` +\| `(\w+)` \|", pages["thesis-numbers.md"], re.MULTILINE
        )
    )
    others = {(run.problem, run.key): run for run in summaries.runs().values()}
    assert len(told) > 150
    for command, key in told:
        _, name, *words = shlex.split(command)
        problem = registry().find(name)
        asked = problem.asked(problem.bind(settings_of(tuple(words[1::2]))))
        if (name, key) in others:
            expected = problem.asked(problem.bind(dict(others[name, key].parameters)))
        else:
            expected = wb.open_run(ROOT / "results" / "reference" / name / key).info["parameters"]
        assert asked == expected, command
