"""Missing values, dead channels and clipped converters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.identification import as_record, saturation

TIME = np.arange(5000)
SINE = np.sin(2 * np.pi * 0.0123 * TIME)


def quantised(signal, step):
    return step * np.round(signal / step)


HEALTHY = {
    "sine": SINE,
    "sine in 12 bits": quantised(SINE, 2**-11),
    "slow sine in 6 bits": quantised(np.sin(2 * np.pi * 0.001 * TIME), 2**-5),
    "fast sine in 6 bits": quantised(np.sin(2 * np.pi * 0.057 * TIME), 2**-5),
    "noise in 12 bits": quantised(np.random.default_rng(0).normal(size=5000), 2**-9),
    "binary": np.sign(SINE),
    "constant": np.ones(100),
    "short": np.array([1.0, 2.0]),
}


@pytest.mark.parametrize("name", HEALTHY)
def test_healthy_records_are_not_flagged(name):
    assert saturation(HEALTHY[name]) == 0


@pytest.mark.parametrize("name", ["sine", "sine in 12 bits", "noise in 12 bits"])
@pytest.mark.parametrize("level", [0.3, 0.8])
def test_clipped_records_are_flagged_with_their_share(name, level):
    signal = HEALTHY[name]
    share = np.mean(np.abs(signal) >= level)
    assert saturation(np.clip(signal, -level, level)) == pytest.approx(share, abs=1e-3)
    upper = np.mean(signal >= level)
    assert saturation(np.minimum(signal, level)) == pytest.approx(upper, abs=1e-3)


def test_given_limits_count():
    shares = saturation(np.stack([SINE, 0.1 * SINE]), limits=(-0.5, 0.5))
    assert shares[0] == pytest.approx(2 / 3, abs=0.01)
    assert shares[1] == 0
    with pytest.raises(InputError, match="rise"):
        saturation(SINE, limits=(1, -1))


@pytest.mark.cases(0)
@settings(derandomize=True, deadline=None)
@given(st.floats(0.2, 0.95), st.floats(0.01, 100), st.floats(-10, 10))
def test_shares_do_not_depend_on_unit_or_offset(level, size, offset):
    clipped = quantised(np.clip(SINE, -level, level), 2**-11)
    whole = np.round(clipped * 2**11)
    assert saturation(whole * size + round(offset)) == pytest.approx(saturation(whole), abs=1e-3)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ([1.0, np.inf], "1 samples .* sample 1"),
        ([[1.0, 2.0], [np.nan, np.nan]], "2 samples .* channel 1, sample 0"),
        ([], "no samples"),
        (3.0, "no samples"),
        (["a"], "real numbers"),
        ([1j], "real numbers"),
    ],
)
def test_bad_records(bad, message):
    with pytest.raises(InputError, match=message):
        as_record(bad)
