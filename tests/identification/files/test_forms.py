"""Of sixty forms of one record most are read right, none wrongly, the rest are refused clearly."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from record_forms import FORMS

from workbench.errors import InputError
from workbench.identification import read_record


@cache
def outcome(name: str) -> str:
    """What comes out: "right", "wrong", or the words of the refusal."""
    form = FORMS[name]
    with TemporaryDirectory() as folder:
        file = form.written(Path(folder))
        try:
            data = read_record(file, **form.call)
        except InputError as error:
            return str(error)
    instants = data["time"].values
    right = (
        data["u"].shape == (1, form.u.size)
        and np.allclose(np.diff(instants), form.step, rtol=1e-6, atol=0)
        and np.array_equal(data["u"].values[0], form.u)
        and np.array_equal(data["y"].values[0], form.y)
    )
    return "right" if right else "wrong"


def test_there_are_sixty():
    assert len(FORMS) == 60


@pytest.mark.parametrize("name", FORMS)
def test_none_is_read_wrongly(name):
    assert outcome(name) != "wrong"


def test_most_are_read():
    refused = [name for name in FORMS if outcome(name) != "right"]
    assert len(refused) <= 8, refused
