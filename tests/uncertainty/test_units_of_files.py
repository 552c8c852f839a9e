"""Files of one set in different units: converted and told, or refused with both files named."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.starter.columns import record_columns
from workbench.starter.first_look import first_look
from workbench.uncertainty import Responses

N, RATE = 1200, 100.0
SAME = 1e-7
"""Files are rounded to 12 digits; that decides which of two fits as good as each other counts."""
RPM = 30 / np.pi


def record(folder, number, head, scale=1.0, instants=1.0, row=""):
    """A first-order plant; its output is scaled."""
    rng = np.random.default_rng(number)
    u, y = rng.standard_normal(N), np.zeros(N)
    for k in range(1, N):
        y[k] = 0.9 * y[k - 1] + 0.1 * (1 + 0.05 * number) * u[k - 1]
    table = np.column_stack([np.arange(N) / RATE * instants, u, scale * y])
    form = {"delimiter": ",", "header": head + row, "comments": "", "fmt": "%.12g"}
    np.savetxt(folder / f"drive{number}.csv", table, **form)
    return folder / f"drive{number}.csv"


def responses(folder, output="speed", **names):
    names = {"input": "torque", "time": "t"} | names
    return Responses.from_files(str(folder / "drive*.csv"), output=output, **names)


OTHERS = {
    "brackets": {"head": "t [s],torque,speed [rpm]", "scale": RPM},
    "strokes": {"head": "t/s,torque,speed/rpm", "scale": RPM},
    "a suffix": {"head": "t,torque,speed_rpm", "scale": RPM},
    "turns": {"head": "t,torque,speed [1/min]", "scale": RPM},
    "a row of units": {"head": "t,torque,speed", "row": "\ns,,rpm", "scale": RPM},
    "degrees and ms": {"head": "t_ms,torque,speed [deg/s]", "scale": 180 / np.pi, "instants": 1e3},
    "unknown": {"head": "t,torque,speed"},
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_the_same_plants_come_out(tmp_path, other):
    record(tmp_path, 1, "t,torque,speed [rad/s]")
    record(tmp_path, 2, "t,torque,speed [rad/s]")
    expected = responses(tmp_path)
    record(tmp_path, 2, **other)
    found = responses(tmp_path)
    np.testing.assert_allclose(found.values, expected.values, rtol=SAME)
    assert found.unit == expected.unit == "rad/s"
    word = "unknown, taken as rad/s" if other == OTHERS["unknown"] else "'speed' converted from"
    assert f"drive2.csv: {word}" in found.read or f"unit of 'speed' {word}" in found.read


def test_units_that_do_not_fit_are_refused(tmp_path):
    record(tmp_path, 1, "t,torque,speed [rad/s]")
    record(tmp_path, 2, "t,torque,speed [V]")
    said = r"drive2\.csv: 'speed' is in 'V', and in 'rad/s' in .*drive1\.csv"
    with pytest.raises(InputError, match=said):
        responses(tmp_path)


@pytest.mark.cases(0)
def test_the_starter_reads_them_too(tmp_path):
    first = record(tmp_path, 1, "t_ms,torque [N m],speed [rad/s]", instants=1e3)
    u, y, t = record_columns(first, None, None, None, None)
    assert (u, y, t) == ("torque [N m]", "speed [rad/s]", "t_ms")
    second = record(tmp_path, 2, "t,torque [N m],speed [rpm]", RPM)
    look = first_look([first, second], u, y, t, None)
    assert look.period == pytest.approx(0.01)
    plain = responses(tmp_path, output=y, input=u, time=t)
    record(tmp_path, 2, "t,torque [N m],speed [rad/s]")
    np.testing.assert_allclose(plain.values, responses(tmp_path).values, rtol=SAME)


def test_the_starter_finds_dates_and_clocks_too(tmp_path):
    clocks = [f"2024-01-31 23:59:{k / 20:06.3f}" for k in range(N)]
    for instants in (clocks, [clock[11:] for clock in clocks]):
        rows = [f"{at},RUN,{(7 * k) % 5},{(3 * k) % 4}" for k, at in enumerate(instants)]
        file = tmp_path / "drive1.csv"
        file.write_text("\n".join(["when,state,torque,speed", *rows]))
        names = record_columns(file, None, None, None, None)
        assert names == ("torque", "speed", "when")
        look = first_look([file], *names, None)
        assert look.period == pytest.approx(0.05)
        assert "unit of 'torque' unknown, taken as 1" in look.columns
