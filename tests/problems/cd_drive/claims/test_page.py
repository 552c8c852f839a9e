"""The pages about the thesis are those of the committed results."""

import importlib.util
import re
from pathlib import Path

import pytest

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
