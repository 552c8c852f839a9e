"""The same question has the same key everywhere; another question has another."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.bench.question import Question, asked, canonical, plain
from workbench.solvers import Options

BASE = {
    "problem": "a/b",
    "parameters": {"n": 3, "width": 0.1, "names": ["u", "v"], "none": None},
    "data": {"d.csv": "00"},
    "needs": {"up": "1234abcd", "many": ["1", "2"]},
    "method": "exact",
    "options": asked(Options()),
}


def key(**changes):
    return Question(**{**BASE, **changes}).key


def test_a_key_is_eight_hexadecimal_digits_and_never_changes():
    assert key() == "af12de19"  # were it another, every stored result would be lost


def test_the_order_of_parameters_does_not_matter():
    assert key(parameters=dict(reversed(BASE["parameters"].items()))) == key()


@pytest.mark.parametrize(
    "change",
    [
        {"problem": "a/c"},
        {"parameters": {**BASE["parameters"], "n": 4}},
        {"parameters": {**BASE["parameters"], "width": math.nextafter(0.1, 1)}},
        {"parameters": {**BASE["parameters"], "names": ["v", "u"]}},
        {"parameters": {**BASE["parameters"], "none": "None"}},
        {"parameters": {**BASE["parameters"], "more": 0}},
        {"data": {"d.csv": "01"}},
        {"data": {"e.csv": "00"}},
        {"needs": {**BASE["needs"], "up": "1234abce"}},
        {"needs": {**BASE["needs"], "many": ["2", "1"]}},
        {"method": "rough"},
        {"method": None},
        {"options": asked(Options(tolerance="high"))},
        {"options": asked(Options(time_limit=1.0))},
        {"options": asked(Options(seed=1))},
    ],
    ids=str,
)
def test_whatever_may_change_the_answer_changes_the_key(change):
    assert key(**change) != key()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Options(tolerance="middle"), Options(tolerance=1e-6)),
        (Options(tolerance="1e-4"), Options(tolerance=1e-4)),
        (Options(verbose=True), Options()),
        (Options(time_limit=60), Options(time_limit=60.0)),
        (Options(seed=3), Options(seed=np.int64(3))),
    ],
    ids=["level or number", "text or number", "verbosity", "seconds as int", "seed of numpy"],
)
def test_one_question_in_two_spellings_has_one_key(one, other):
    assert key(options=asked(one)) == key(options=asked(other))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(JSON)
def test_a_plain_value_is_json_and_stays_as_it_is(value):
    once = plain(value)
    assert plain(json.loads(json.dumps(once, allow_nan=False))) == once
    assert canonical(value) == canonical(once)


def test_numpy_values_are_plain_numbers():
    assert canonical({"b": np.float64(0.5), "a": (np.int8(1), np.bool_(True))}) == (
        '{"a":[1,true],"b":0.5}'
    )
    assert canonical([math.nan, math.inf, -math.inf]) == '["nan","inf","-inf"]'


def test_the_key_of_a_cell_is_longer_and_counts_its_repetitions():
    question = Question("toy/root", {}, {}, {}, "exact", {"tolerance": 1e-3})
    cells = [question.as_cell(number, None) for number in range(3)]
    assert not question.is_cell and len(question.key) == 8
    assert all(cell.is_cell and len(cell.key) == 16 for cell in cells)
    assert len({cell.key for cell in cells} | {question.as_cell(0, 2**30).key}) == 4
