"""Labels of samples tell the sampling time, or are refused by name: none is passed over."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from workbench.errors import InputError
from workbench.identification import as_experiments

N = 50
RNG = np.random.default_rng(0)
U, Y = RNG.standard_normal(N), RNG.standard_normal(N)
PLAIN = pd.date_range("2024-03-31 00:59:50", periods=N, freq="500ms")
SHUFFLED = RNG.permutation(N)


def frames(index, other=None):
    other = index if other is None else other
    return pd.Series(U[: len(index)], index), pd.DataFrame({"y": Y[: len(other)]}, other)


TOLD = {
    "dates": (PLAIN, 0.5),
    "a time zone": (PLAIN.tz_localize("UTC"), 0.5),
    "the change to summer time": (PLAIN.tz_localize("UTC").tz_convert("Europe/Berlin"), 0.5),
    "periods": (pd.period_range("2024-01-01", periods=N, freq="min"), 60.0),
    "texts": (pd.Index([str(at) for at in PLAIN]), 0.5),
    "texts with a zone": (pd.Index([f"{at}+02:00" for at in PLAIN]), 0.5),
    "objects": (pd.Index(PLAIN.to_pydatetime(), dtype=object), 0.5),
    "clocks": (pd.Index([f"{at:%H:%M:%S.%f}" for at in PLAIN]), 0.5),
    "times": (pd.to_timedelta(np.arange(N) * 0.25, unit="s"), 0.25),
    "seconds": (pd.Index(np.arange(N) * 0.02), 0.02),
    "t_ms": (pd.Index(np.arange(N) * 20, name="t_ms"), 0.02),
    "Time [min]": (pd.Index(np.arange(N) * 0.5, name="Time [min]"), 30.0),
    "rows": (pd.RangeIndex(N), 1.0),
    "later rows": (pd.RangeIndex(7, 7 + N), 1.0),
}


@pytest.mark.parametrize(("index", "step"), TOLD.values(), ids=TOLD)
def test_labels_tell_the_sampling_time(index, step):
    assert as_experiments(*frames(index)).dt == pytest.approx(step, rel=1e-9)


@pytest.mark.parametrize("zone", [None, "UTC", "Asia/Tokyo"])
@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (SHUFFLED, "not equidistant and rising"),
        (np.delete(np.arange(N), 20), "not equidistant and rising at sample 20"),
        (np.arange(N)[::-1], "not equidistant and rising"),
        (np.insert(np.arange(N - 1), 9, 9), "not equidistant and rising"),
    ],
)
def test_rows_out_of_place_are_refused(zone, rows, said):
    index = PLAIN.tz_localize(zone)[rows]
    for given in (index, pd.Index([str(at) for at in index])):
        with pytest.raises(InputError, match=said):
            as_experiments(*frames(given))


WRONG = {
    "shifted dates": ((PLAIN, PLAIN.shift(3)), r"y begins 1\.5 s after u"),
    "half a sample": ((PLAIN, PLAIN.shift(1, "250ms")), r"y begins 0\.25 s after u"),
    "shifted zones": (
        (PLAIN.tz_localize("UTC"), PLAIN.tz_localize("Asia/Tokyo")), "y begins -32400 s after u",
    ),
    "shifted texts": (
        (pd.Index(map(str, PLAIN)), pd.Index(map(str, PLAIN.shift(3)))), r"y begins 1\.5 s after u",
    ),
    "shifted rows": ((pd.RangeIndex(N), pd.RangeIndex(4, 4 + N)), "y begins 4 rows after u"),
    "a zone and none": ((PLAIN, PLAIN.tz_localize("UTC")), "dates without a time zone and those"),
    "dates and seconds": ((PLAIN, pd.Index(np.arange(N) * 0.5)), "give both the same"),
    "words": ((pd.Index([f"row {k}" for k in range(N)]), None), "'row 0' of sample 0 is no date"),
    "two levels": (
        (pd.MultiIndex.from_product([range(5), range(10)]), None), "an index of 2 levels",
    ),
    "classes": ((pd.Index([True, False] * 25), None), "labelled by bool"),
    "rows that are missing": ((pd.Index(np.delete(np.arange(N + 1), 9)), None), "at sample 9"),
    "a strange unit": ((pd.Index(np.arange(N), name="t [V]"), None), "'V' cannot be converted"),
}  # fmt: skip


@pytest.mark.parametrize(("pair", "said"), WRONG.values(), ids=WRONG)
def test_labels_that_fit_nothing_are_refused(pair, said):
    with pytest.raises(InputError, match=said):
        as_experiments(*frames(*pair))


def test_labelled_arrays_too():
    data = xr.Dataset({"u": ("time", U), "y": ("time", Y)}, {"time": np.arange(N) / 3600})
    data["time"].attrs["units"] = "hours"
    assert as_experiments(data, None).dt == pytest.approx(1.0)
    data["time"] = [f"2024-01-01 00:{k:02d}:00" for k in range(N)]
    assert as_experiments(data, None).dt == pytest.approx(60.0)
    data["time"] = [object()] * N
    with pytest.raises(InputError, match="labelled by object"):
        as_experiments(data, None)
