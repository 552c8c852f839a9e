"""The page about the thesis is that of the committed results."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[4]


def test_the_page_is_made_of_the_reference_result():
    spec = importlib.util.spec_from_file_location("thesis", ROOT / "docs" / "thesis.py")
    thesis = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(thesis)
    made = "run `make thesis`: docs/thesis.md is not the page of results/reference"
    assert (ROOT / "docs" / "thesis.md").read_text(encoding="utf-8") == thesis.page(), made
