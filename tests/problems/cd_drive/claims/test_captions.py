"""Figures of stored studies say which figures of the thesis they are."""

import re

import pytest
from workbench.plants.cd_drive.claims.problem import items

NUMBER = re.compile(r"\b([0-9A]\.\d+)\b")


def cited():
    """Runs and figures that an item of a figure of the thesis shows, with that figure's number."""
    found = set()
    for _, item in items():
        _, figure, where = item.place.partition("igure")
        runs = sorted({number.run for number in item.numbers})
        if figure and runs:
            shown = (one.strip() for one in item.shown.split(","))
            found |= {
                (runs[0], one, number) for one in shown for number in NUMBER.findall(where)[:1]
            }
    return sorted(found)


@pytest.mark.slow
@pytest.mark.parametrize(("run", "shown", "number"), cited())
def test_a_figure_of_the_thesis_carries_its_number(reference, run, shown, number):
    stored = reference(run)
    drawn = stored.task.figures(stored.answer)
    if shown not in drawn:
        pytest.skip("a table shows it")
    assert re.search(rf"\b{re.escape(number)}\b", drawn[shown].get_suptitle())
