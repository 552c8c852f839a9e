"""The constants of rooms can be halved and doubled one at a time."""

from pathlib import Path

import pytest
from constants.listed import FACTORS, changed, constants

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("value", "half", "double"),
    [
        (0.3, 0.15, 0.6),
        (1.02, 1.01, 1.04),  # a factor just above 1
        (0.999, 0.9995, 0.998),  # a share just below 1
        (5, 2, 10),
        (1, 0, 2),
    ],
)
def test_numbers_near_one_change_their_distance_from_it(value, half, double):
    found = [changed(value, factor) for factor in FACTORS.values()]
    assert found == pytest.approx([half, double])
    assert [type(one) for one in found] == [type(value)] * 2


def test_each_constant_is_found_once_and_changes():
    texts, found = {}, constants(ROOT)
    assert len(found) > 300 and len({str(one) for one in found}) == len(found)
    wrong = []
    for one in found:
        text = texts.setdefault(one.file, (ROOT / one.file).read_text("utf-8"))
        spaces = {}
        exec(f"from __future__ import annotations\n{one.times(2.0)}", spaces)
        names = one.name.split(", ")
        after = spaces[names[0]] if len(names) == 1 else tuple(spaces[name] for name in names)
        if text.count(one.old) != 1 or after == one.value:
            wrong.append(str(one))
    assert not wrong, wrong
