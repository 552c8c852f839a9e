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


def test_decimal_commas_beside_clocks_and_switches(tmp_path):
    """One column has numbers: commas seemed to separate columns, and no line to name them."""
    rows = [f"10:00:{k:02d};{'TRUE' if k % 3 else 'FALSE'};{20 + k / 8:.3f}" for k in range(9)]
    file = tmp_path / "log.csv"
    file.write_text("time;power;temp\nhh:mm:ss;%;°C\n" + "\n".join(rows).replace(".", ","))
    data = read_record(file, ["power"], ["temp"], time="time")
    assert data["y"].values[0].tolist() == [20 + k / 8 for k in range(9)]
    assert data["u"].values[0].tolist() == [float(k % 3 > 0) for k in range(9)]
