"""Units of columns: as people write them, told by names, and never taken for a name's end."""

import subprocess
import sys

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.identification.files.names import SUFFIXES, split_name
from workbench.identification.files.units import converted, is_unit

NAMES = {
    ("t_ms", "time"): ("t", "ms"),
    ("t/ms", "time"): ("t", "ms"),
    ("millis", "time"): ("millis", "millis"),
    ("timeMs", "time"): ("time", "ms"),
    ("timestamp_us", "time"): ("timestamp", "us"),
    ("Time [ms]", "time"): ("Time", "ms"),
    ("Zeit in s", "time"): ("Zeit", "s"),
    ("t<ms>", "time"): ("t", "ms"),
    ("f_kHz", "frequency"): ("f", "kHz"),
    ("f_mHz", "frequency"): ("f", "mHz"),
    ("f_MHz", "frequency"): ("f", "MHz"),
    ("w_rad_s", "frequency"): ("w", "rad/s"),
    ("speed_rpm", "signal"): ("speed", "rpm"),
    ("w_rad/s", "frequency"): ("w", "rad/s"),
    ("speed_rad/s", "signal"): ("speed", "rad/s"),
    ("arm speed M/s", "signal"): ("arm speed", "m/s"),
    ("flow_l/min", "signal"): ("flow", "l/min"),
    ("v_km/h", "signal"): ("v", "km/h"),
    ("t_m/s", "time"): ("t_m", "s"),
    ("acceleration_m/s^2", "signal"): ("acceleration", "m/s^2"),
    ("speed_mean/rpm", "signal"): ("speed_mean", "rpm"),
    ("gain_db", "magnitude"): ("gain", "dB"),
    ("torque / (N m)", "signal"): ("torque", "N m"),
    # ends of names that are no units
    ("T_min", "signal"): ("T_min", None),
    ("u_s", "signal"): ("u_s", None),
    ("phase_A", "signal"): ("phase_A", None),
    ("T_in", "signal"): ("T_in", None),
    ("y/u", "signal"): ("y/u", None),
    ("stopped in time", "signal"): ("stopped in time", None),
    ("y[0]", "signal"): ("y[0]", None),
    ("items", "time"): ("items", None),
}


@pytest.mark.parametrize(("given", "expected"), NAMES.items(), ids=lambda one: str(one[0]))
def test_units_in_names(given, expected):
    assert split_name(*given) == expected


SUFFIX_SIZES = {
    "hz": ("Hz", 1.0), "khz": ("Hz", 1e3), "mhz": ("Hz", 1e6), "ghz": ("Hz", 1e9),
    "rpm": ("rad/s", np.pi / 30), "rad_s": ("rad/s", 1.0), "rads": ("rad/s", 1.0),
    "radps": ("rad/s", 1.0), "deg_s": ("rad/s", np.pi / 180),
    "nm": ("N m", 1.0), "mnm": ("N m", 1e-3), "rad": ("rad", 1.0), "deg": ("rad", np.pi / 180),
    "degc": ("°C", 1.0), "degf": ("°F", 1.0), "mv": ("V", 1e-3), "kv": ("V", 1e3),
    "ma": ("A", 1e-3), "mm": ("m", 1e-3), "um": ("m", 1e-6), "m_s": ("m/s", 1.0),
    "mm_s": ("m/s", 1e-3), "kpa": ("Pa", 1e3), "mbar": ("Pa", 100.0), "psi": ("Pa", 6894.757),
}  # fmt: skip


def test_a_suffix_is_the_unit_that_people_mean():
    """In lower case, pint reads nm as a nanometre, and kn as a knot."""
    suffixes = {one for role in ("frequency", "signal") for one in SUFFIXES[role].split("|")}
    other = suffixes ^ set(SUFFIX_SIZES)
    assert not other, f"say in SUFFIX_SIZES what these suffixes mean: {sorted(other)}"
    for suffix, (unit, size) in SUFFIX_SIZES.items():
        in_signals = suffix in SUFFIXES["signal"].split("|")
        told = split_name(f"x_{suffix}", "signal" if in_signals else "frequency")[1]
        assert told is not None, suffix
        found = converted(np.array([3.0]), told, unit)
        assert found == pytest.approx(3.0 * size, rel=1e-6), suffix


SECONDS = {
    "ms": 1e-3, "msec": 1e-3, "millis": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9,
    "sec": 1.0, "Seconds": 1.0, "S": 1.0, "MS": 1e-3, "min": 60.0, "h": 3600.0, "hours": 3600.0,
    "days since 2024-01-01": 86400.0,
}  # fmt: skip


@pytest.mark.parametrize(("unit", "seconds"), SECONDS.items())
def test_times(unit, seconds):
    assert converted(np.array([2.0]), unit, "s") == pytest.approx(2 * seconds, rel=1e-12)


PAIRS = {
    ("rpm", "rad/s"): np.pi / 30,
    ("1/min", "rad/s"): np.pi / 30,
    ("min^-1", "rpm"): 1.0,
    ("U/min", "rpm"): 1.0,
    ("rev/s", "Hz"): 1.0,
    ("Hz", "rad/s"): 2 * np.pi,
    ("rad/s", "Hz"): 1 / (2 * np.pi),
    ("deg/s", "rad/s"): np.pi / 180,
    ("1/s", "Hz"): 1.0,
    ("KHZ", "Hz"): 1e3,
    ("mNm", "N m"): 1e-3,
    ("N·m", "Nm"): 1.0,
    ("m/s2", "m/s^2"): 1.0,
    ("cm/s²", "m/s**2"): 1e-2,
    ("mbar", "Pa"): 100.0,
    ("%", "1"): 0.01,
}


@pytest.mark.parametrize(("pair", "factor"), PAIRS.items())
def test_what_is_measured_alike_is_converted(pair, factor):
    assert converted(np.array([3.0]), *pair) == pytest.approx(3 * factor, rel=1e-12)


def test_temperatures_keep_their_zero():
    np.testing.assert_allclose(converted(np.array([32.0, 212.0]), "°F", "°C"), [0, 100], atol=1e-9)


@pytest.mark.parametrize(
    ("unit", "to", "said"),
    [
        ("V", "rad/s", "'V' cannot be converted to 'rad/s'"),
        ("dB", "1", "'dB' cannot be converted"),
        ("quux", "s", "the unit 'quux' is not known"),
        ("9**9**9**9", "s", "is not known"),
        ("s" * 1000, "s", "is not known"),
    ],
)
def test_what_is_not_is_refused(unit, to, said):
    with pytest.raises(InputError, match=said):
        converted(np.array([1.0]), unit, to)


def test_names_of_signals_are_no_units():
    assert not any(map(is_unit, ("t", "u", "y", "x", "r", "torque", "speed", "out", "ref", "")))


def test_the_list_of_problems_does_not_wait_for_pint():
    code = "import sys, workbench.cli, workbench.identification; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
