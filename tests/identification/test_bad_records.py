"""Records that are wrong in one way each: the message says which, where, and what to do."""

import itertools

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from tables import each

from workbench.errors import InputError
from workbench.identification import (
    SampledRecord,
    StateSpaceFit,
    SteppedSine,
    periodic_local_polynomial,
    periodic_local_rational,
    sine_fit,
    spectral_response,
    step_response,
)

N = 300
RNG = np.random.default_rng(0)
U, Y = RNG.standard_normal((N, 2)), RNG.standard_normal((N, 3))
CHANNELS = [("u", j) for j in range(2)] + [("y", j) for j in range(3)]
PLACES = (0, 1, 7, 150, N - 1)


def given(name=None, values=None, **options):
    record = {"u": U, "y": Y} | ({} if name is None else {name: values})
    return record["u"], record["y"], options


def edited(name, channel, rows, value):
    values = {"u": U, "y": Y}[name].copy()
    values[rows, channel] = value
    return values


def labelled(u=U, y=Y, time=None, names=("force", "flow")):
    time = np.arange(N) * 0.1 if time is None else time
    return xr.Dataset(
        {"u": (("time", "input"), u), "y": (("time", "output"), y)},
        coords={"time": time, "input": list(names)},
    )


def broken_time(place, kind):
    time = np.arange(N) * 0.1
    if kind == "gap":
        time[place:] += 3.0
    elif kind == "repeated":
        time[place] = time[place - 1]
    else:
        time = time[::-1].copy()
    return time


def records():
    for (name, j), t, size in itertools.product(CHANNELS, PLACES, (np.inf, -np.inf)):
        said = rf"{name} has 1 samples that are infinite.*channel {j}, sample {t}: .*cut the record"
        yield f"infinite-{name}{j}-{t}-{size}", given(name, edited(name, j, t, size)), said
    for name, j in CHANNELS:
        for value in (0.0, 5.0):
            said = rf"{name}: channel {j} .*never changes: check its cable"
            yield f"dead-{name}{j}-{value}", given(name, edited(name, j, slice(None), value)), said
    for j, lost in itertools.product(range(3), (0.6, 0.8, 1.0)):
        values = edited("y", j, slice(0, int(lost * N)), np.nan)
        yield f"missing-y{j}-{lost}", given("y", values), rf"channel {j}.*are missing.*leave"
    for j in range(2):
        values = edited("u", j, slice(None), np.nan)
        yield f"no-input-{j}", given("u", values), "no sample has all inputs; fill the gaps"
    for name, cut in itertools.product("uy", (1, 5, 100, 299)):
        values = {"u": U, "y": Y}[name][:-cut]
        yield (
            f"shorter-{name}-{cut}",
            given(name, values),
            rf"{N - cut}.*must be equal|must be equal",
        )
    for name, wrong in itertools.product(
        "uy", (None, "text", 3.0, [], [[]], {}, object(), np.zeros((3, 4, 5)), np.zeros((N, 0)))
    ):
        if not (name == "y" and wrong is None):
            values = given(name, wrong)
            yield (
                f"no-array-{name}-{type(wrong).__name__}-{np.shape(wrong)}",
                values,
                (rf"{name} (must hold|has shape)|list of experiments|is a list|experiments"),
            )
    yield "no-outputs", (U, None, {}), "y is missing and u is a ndarray; give y"
    for name, dtype in itertools.product("uy", (complex, "U8", "datetime64[s]", object)):
        plain = {"u": U, "y": Y}[name]
        values = plain * 1j if dtype is complex else plain.astype("int64").astype(dtype)
        if dtype is object:
            values[3, 1] = "n/a"
        yield f"type-{name}-{dtype}", given(name, values), f"{name} must hold real numbers"
    for name in "uy":
        ragged = [list(row) for row in {"u": U, "y": Y}[name]]
        ragged[4] = ragged[4][:-1]
        yield f"ragged-{name}", given(name, ragged), f"{name} must hold real numbers in rows"
    for value in (0, -1, -0.1, np.nan, np.inf, "1", [1.0], True):
        yield f"time-{value}", given(dt=value), "dt is .*positive"
    for value in (0, -3, 2.5, "all", N, N - 1, N + 5, 3, 40):
        yield (
            f"estimation-{value}",
            given(estimation=value, washout=20),
            ("estimation is .*integer of at least 1|leave parts of .*take a longer record"),
        )
    for value in (0, -1, 1.5, "x", 64, 100, N):
        yield (
            f"washout-{value}",
            given(washout=value),
            ("washout is .*integer of at least 1|leave parts of .*shorter washout"),
        )
    for value in ((), (0,), (-1,), (1, 0), (99,), (2.5,), ("two",), 3, "3", (True,), (2, 500)):
        yield (
            f"orders-{value}",
            given(orders=value),
            ("no orders|does not fit the data.*choose lower|whole number"),
        )
    for value in (-1, 1.5, "auto", (1,), (1, 2, 3), (1, -1), N, 200, [None, 1]):
        yield (
            f"delay-{value}",
            given(delay_samples=value),
            "delay(_samples| .samples.)? is|delays are given for 2 inputs|give a shorter delay",
        )
    for value in ("unstable", 1.0, None, ""):
        yield f"poles-{value}", given(poles=value), '"stable", "marginal" or "any"'
    for value in (0, 1, "yes", None):
        yield f"direct-{value}", given(direct=value), "it must be True or False"
    for value in ("row", 0, "time"):
        yield f"samples-{value}", given(samples=value), '"rows", "columns" or None'
    yield "square", (U[:2], U[2:4], {}), 'samples="rows"'
    yield "samples-turned", given(samples="columns"), "2 samples and y 3|must be equal"
    for place, kind in itertools.product((5, 100, 250), ("gap", "repeated", "falling")):
        time = broken_time(place, kind)
        yield f"{kind}-{place}", (labelled(time=time), None, {}), "not equidistant.*resample|cut it"
        frame = (pd.DataFrame(U, time), pd.DataFrame(Y, time), {})
        yield f"frame-{kind}-{place}", frame, "not equidistant.*resample|cut it"
    yield "twice-named", (labelled(names=("a", "a")), None, {}), "two channels of u have one name"
    yield "no-u", (labelled().drop_vars("u"), None, {}), "u and y are needed: rename"
    yield "no-y", (labelled().drop_vars("y"), None, {}), "u and y are needed: rename"
    yield "no-time", (labelled().rename(time="row"), None, {}), '"time" and at most one'
    slow = labelled(time=np.arange(N) * 0.3)["y"]
    yield "other-rates", (labelled()["u"], slow, {}), "resample one of them"
    pairs = {
        "one-list": ([U, U], Y, "both as lists"),
        "other-list": (U, [Y, Y], "both as lists"),
        "counts": ([U, U], [Y], "2 experiments and y 1"),
        "none": ([], [], "0 experiments and y 0|experiments"),
        "inputs": ([U, U[:, :1]], [Y, Y], "u of experiment 1 has 1 channels"),
        "outputs": ([U, U], [Y, Y[:, :2]], "y of experiment 1 has 2 channels"),
        "lengths": ([U, U], [Y, Y[:-1]], "must be equal"),
        "infinite": ([U, U], [Y, edited("y", 1, 9, np.inf)], "channel 1, sample 9"),
    }
    for kind, (u, y, said) in pairs.items():
        yield f"experiments-{kind}", (u, y, {}), said
    renamed = [labelled(), labelled(names=("force", "heat"))]
    yield "experiments-names", (renamed, None, {}), "inputs of experiment 1 are force, heat"
    rates = [labelled(), labelled(time=np.arange(N) * 0.2)]
    yield "experiments-rates", (rates, None, {}), "resample them to one time"
    for count in (1, 2, 5, 9, 12, 20):
        yield (
            f"short-{count}",
            (U[:count, :1], Y[:count, :1], {"samples": "rows"}),
            ("longer record|never changes"),
        )


RECORDS = {name: (record, said) for name, record, said in records()}


def test_there_are_many():
    assert len(RECORDS) >= 200


@each(("record", "said"), RECORDS.values(), ids=RECORDS)
def test_the_message_says_which_and_what_to_do(record, said):
    u, y, options = record
    with pytest.raises(InputError, match=said) as caught:
        StateSpaceFit(u, y, **options)
    assert len(str(caught.value)) > 30


@pytest.mark.parametrize("dt", [0, 0.0, -0.1, np.nan, np.inf, None, "0.1"])
def test_a_sampling_time_that_is_none_is_named(dt):
    u, y = U[:, :1], Y[:, :1]
    calls = (
        lambda: SteppedSine([1.0], 2, 1.0, dt),
        lambda: sine_fit(u[:, 0], dt, 1.0),
        lambda: step_response(u[:, 0], y[:, 0], [50, 100, 150], [1.0], dt, 40),
        lambda: spectral_response(u.T, y.T, dt=dt, segment=20),
        lambda: periodic_local_polynomial(u, y, 30, dt=dt),
        lambda: periodic_local_rational(u, y, 30, dt=dt),
        lambda: SampledRecord(u[:, 0], y[:, 0], dt),
    )
    for call in calls:
        with pytest.raises(InputError, match="dt is "):
            call()
