"""Solutions are found, outputs kept small, and differences told."""

import base64
import io

import nbformat
import pytest
from PIL import Image

from workbench.course.execution import (
    COLOURS,
    code_of_solutions,
    few_colours,
    keep_small,
    output_differences,
    stale,
)

HIDDEN = """<details><summary>Solution</summary>

Because so.

```python
assert a == 1
```

```python
a = 2
```

</details>"""


def notebook(text="", tags=()):
    cell = nbformat.v4.new_code_cell("a = 1\nprint(a)", metadata={"tags": list(tags)})
    cell.outputs = [nbformat.v4.new_output("stream", name="stdout", text=text)]
    hidden = nbformat.v4.new_markdown_cell(HIDDEN, metadata={"tags": ["solution"]})
    return nbformat.v4.new_notebook(cells=[cell, hidden])


def test_code_of_solutions_is_that_of_tagged_cells():
    one = notebook()
    assert code_of_solutions(one) == ["assert a == 1\n", "a = 2\n"]
    one.cells[1].metadata["tags"] = []
    assert code_of_solutions(one) == []


@pytest.mark.parametrize(
    ("before", "after", "alike"),
    [
        ("peak 1.000 at 30 Hz", "peak 1.004 at 30 Hz", True),
        ("peak 1.000 at 30 Hz", "peak 1.04 at 30 Hz", False),
        ("holds True", "holds False", False),
        ("gap 0", "gap 1e-12", True),
    ],
)
def test_numbers_may_differ_by_little_and_words_not_at_all(before, after, alike):
    assert (output_differences(notebook(before), notebook(after)) == []) == alike


def test_what_varies_is_not_compared():
    assert output_differences(notebook("2 s", ["varies"]), notebook("7 s", ["varies"])) == []


def test_what_is_kept_is_small_sealed_and_without_warnings():
    one = notebook("1\n")
    one.cells[0].outputs += [
        nbformat.v4.new_output("stream", name="stderr", text="a warning"),
        nbformat.v4.new_output("stream", name="stdout", text="2\n"),
    ]
    assert stale(one)
    kept = keep_small(one)
    assert not stale(kept)
    assert [output.text for output in kept.cells[0].outputs] == ["1\n2\n"]


@pytest.mark.cases(0)
def test_a_kept_picture_has_few_colours():
    file = io.BytesIO()
    Image.effect_noise((1800, 1200), 90.0).convert("RGB").save(file, format="PNG")
    one = notebook()
    data = {"image/png": base64.b64encode(file.getvalue()).decode(), "text/plain": "<Picture>"}
    one.cells[0].outputs = [nbformat.v4.new_output("display_data", data=data)]
    (output,) = keep_small(one).cells[0].outputs
    kept = base64.b64decode(output.data["image/png"])
    assert list(output.data) == ["image/png"] and len(kept) < len(file.getvalue()) / 2
    assert Image.open(io.BytesIO(kept)).size == (900, 600)
    assert len(Image.open(io.BytesIO(few_colours(kept))).getcolors()) <= COLOURS
