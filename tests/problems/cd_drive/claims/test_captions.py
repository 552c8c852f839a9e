"""Figures of stored studies say which figures of the thesis they are."""

import re

import pytest
from workbench.plants.cd_drive.claims.chapters import items

from workbench.figures import numbers_in

NUMBER = re.compile(r"\b([0-9A]\.\d+)\b")


def cited():
    """Runs and figures that an item of a figure of the thesis shows, with the numbers they carry.

    Those of the figure's own name, or else the first that the item's place has.
    """
    found = set()
    for _, item in items():
        _, figure, where = item.place.partition("igure")
        runs = sorted({number.run for number in item.numbers})
        for one in filter(None, (name.strip() for name in item.shown.split(","))):
            numbers = numbers_in(one) or NUMBER.findall(where)[:1]
            if runs and (numbers_in(one) or figure):
                found.add((runs[0], one, " ".join(numbers)))
    return sorted(found)


@pytest.mark.slow
@pytest.mark.parametrize(("run", "shown", "numbers"), cited())
def test_a_figure_of_the_thesis_carries_its_number(reference, run, shown, numbers):
    stored = reference(run)
    drawn = stored.task.figures(stored.answer)
    if shown not in drawn:
        pytest.skip("a table shows it")
    panels = (panel.get_title() for panel in drawn[shown].axes)
    caption = " ".join([drawn[shown].get_suptitle(), *panels])
    assert all(re.search(rf"\b{re.escape(one)}\b", caption) for one in numbers.split())
