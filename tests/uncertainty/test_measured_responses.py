"""From records and curves in files to responses with variances, and covers of the plants alone."""

import warnings

import control
import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError, UnknownNameError
from workbench.identification import IdentificationWarning, ResponseEstimate
from workbench.identification.record_tests.periods import period
from workbench.identification.responses.of_records import record_responses
from workbench.solution import solve
from workbench.uncertainty import CircleCover, Responses, StadiumCover, contains
from workbench.uncertainty.responses.regions import region_radius, with_regions

RATE, SAMPLES, PERIODS, PLANTS = 1000.0, 500, 6, 6
TIME = np.arange(SAMPLES * PERIODS) / RATE
LINES = np.arange(1, 120, 2)

NAMES = {"input": "torque", "output": "speed", "time": "t"}


def plant(k):
    """A lightly damped second-order plant with its own gain and frequency, sampled."""
    gain, rate = 1 + 0.05 * k, 2 * np.pi * (20 + 0.4 * k)
    return control.c2d(control.tf([gain * rate**2], [1, 0.6 * rate, rate**2]), 1 / RATE)


def excitation(rng, *, periodic):
    if not periodic:
        return rng.normal(size=TIME.size)
    phases = rng.uniform(0, 2 * np.pi, LINES.size)[:, None]
    one = np.cos(2 * np.pi * LINES[:, None] * np.arange(SAMPLES) / SAMPLES + phases).sum(axis=0)
    return np.tile(one / np.sqrt(LINES.size), PERIODS)


def recorded(seed=0, *, periodic=True, noise=0.01):
    """Records (u, y) of the plants, with noise on y."""
    rng = np.random.default_rng(seed)
    u = excitation(rng, periodic=periodic)
    before = np.tile(u, 2) if periodic else u
    found = []
    for k in range(PLANTS):
        t = np.arange(before.size) / RATE
        y = control.forced_response(plant(k), t, before).outputs[-u.size :]
        found.append((u, y + noise * rng.normal(size=u.size)))
    return found


def truth(frequency):
    return np.stack(
        [plant(k)(np.exp(2j * np.pi * frequency / RATE)) for k in range(PLANTS)], axis=1
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Six CSV files as loggers write them."""
    place = tmp_path_factory.mktemp("records")
    for k, (u, y) in enumerate(recorded()):
        rows = [f"{t:.4f},{a:.9f},{b:.9f},2026-01-01," for t, a, b in zip(TIME, u, y, strict=True)]
        head = "logger 3,,,,\nt,torque,speed,day,\ns,Nm,rad/s,-,"
        (place / f"drive{k + 1}.csv").write_text("\n".join([head, *rows]) + "\n")
    return place


def read(folder, **names):
    return Responses.from_files(folder / "drive*.csv", **(NAMES | names))


def test_files_give_responses_with_names_units_and_what_was_found_out(folder):
    found = read(folder)
    assert found.plants == tuple(f"drive{k + 1}" for k in range(PLANTS))
    assert found.unit == "(rad/s)/Nm"
    for words in ("commas", "units below", "6 periods of 500 samples", "60 excited lines"):
        assert words in found.read
    np.testing.assert_allclose(found.frequency_hz, LINES * RATE / SAMPLES)
    error = np.abs(found.values - truth(found.frequency_hz))
    assert (error < 5 * np.sqrt(found.variance)).all()


def test_without_the_hold_the_response_is_the_plants(folder):
    """Six plants behind a hold: their own responses, to what images add below 0.1 of the rate."""
    found = read(folder, hold=True).within(0.0, 0.1 * RATE)
    assert found.read.endswith("the hold of the input is taken out")
    s = 2j * np.pi * found.frequency_hz[:, None]
    k = np.arange(PLANTS)
    gain, rate = 1 + 0.05 * k, 2 * np.pi * (20 + 0.4 * k)
    own = gain * rate**2 / (s**2 + 0.6 * rate * s + rate**2)
    apart = np.abs(found.values - own)
    assert (apart < 5 * np.sqrt(found.variance) + 0.02 * np.abs(own)).all()
    held = read(folder).within(0.0, 0.1 * RATE)
    assert np.abs(held.values[-1] / own[-1] - 1).min() > 0.2
    turn = held.frequency_hz[:, None] / RATE
    size = np.sqrt(held.variance / found.variance)
    np.testing.assert_allclose(size, np.broadcast_to(np.sinc(turn), size.shape))


def test_drive_10_stands_behind_drive_9(tmp_path):
    for k in (1, 2, 9, 10):
        (tmp_path / f"d{k}.csv").write_text("f,re,im\n1,1,0\n2,2,1\n3,3,1\n")
    found = Responses.from_files(tmp_path / "d*.csv", frequency="f", response=("re", "im"))
    assert found.plants == ("d1", "d2", "d9", "d10")
    np.testing.assert_allclose(found.frequency_hz, [1, 2, 3])
    assert found.values[1, 0] == 2 + 1j and found.variance is None


@pytest.mark.cases(0)
@pytest.mark.parametrize("periodic", [True, False], ids=["periodic", "arbitrary"])
def test_regions_hold_the_truth_as_often_as_they_say(periodic):
    inside = []
    for seed in range(20 if periodic else 5):
        estimates, _ = record_responses(recorded(seed, periodic=periodic), RATE, 40)
        found = Responses.from_estimates(estimates)
        away = np.abs(found.values - truth(found.frequency_hz))
        inside.append(away <= region_radius(found, 0.9))
    shares = np.mean(inside, axis=(0, 2))
    if periodic:
        assert shares.mean() == pytest.approx(0.9, abs=0.03)
    else:  # what smoothing may hide is counted beside the noise: at least as often as is said
        assert shares.mean() > 0.9
        assert shares[np.abs(found.frequency_hz - 20) < 12].min() > 0.8


def test_of_few_periods_the_neighbouring_lines_tell_the_noise():
    records = [(u[-3 * SAMPLES :], y[-3 * SAMPLES :]) for u, y in recorded(2)]
    estimates, said = record_responses(records, RATE, 40)
    assert said.startswith("3 periods of 500 samples, averaged; 60 excited lines, 25 taken")
    found = Responses.from_estimates(estimates)
    away = np.abs(found.values - truth(found.frequency_hz))
    assert (away <= region_radius(found, 0.95)).mean() > 0.93
    assert estimates[0].degrees > 2 * 2  # those of three periods


def test_frequencies_of_which_a_record_tells_nothing_are_left_out_and_said():
    rng = np.random.default_rng(3)
    slow = np.convolve(rng.normal(size=4000), np.hanning(400), "same")
    noise = 0.01 * rng.normal(size=(2, 4000))
    records = [(slow, np.convolve(slow, [0.5, 0.5])[:4000] + one) for one in noise]
    estimates, said = record_responses(records, RATE, 50)
    assert "left out, where a record tells nothing" in said
    assert estimates[0].frequency_hz.size < 50 and estimates[0].frequency_hz[-1] < 250.0


def test_resonances_narrower_than_the_distance_of_the_frequencies_are_said():
    rng = np.random.default_rng(5)
    u = rng.normal(size=(2, 4000))
    noise = 1e-3 * rng.normal(size=(2, 4000))
    sharp = [0.0, 0.0, 0.02], [1.0, -2 * 0.9995 * np.cos(0.5), 0.9995**2]
    wide = [0.0, 0.0, 0.02], [1.0, -2 * 0.9 * np.cos(0.5), 0.81]
    texts = [
        record_responses(list(zip(u, lfilter(*plant, u) + noise, strict=True)), RATE, 50)[1]
        for plant in (sharp, wide)
    ]
    assert "may be higher between them" in texts[0] and "near 77.7" in texts[0]
    assert "higher between" not in texts[1]


def test_records_of_unlike_lengths_are_used_whole():
    u, y = recorded(4, periodic=False)[0]
    short, _ = record_responses([(u[:800], y[:800])] * 2, RATE, 20)
    both, _ = record_responses([(u[:800], y[:800]), (u, y)], RATE, 20)
    np.testing.assert_array_equal(both[0].frequency_hz, short[0].frequency_hz)
    assert (both[1].variance != both[0].variance).all()
    away = np.abs(both[1].response[:, 0, 0] - truth(both[1].frequency_hz)[:, 0])
    assert (away <= both[1].radius(confidence=0.95)[:, 0, 0]).mean() > 0.93


@pytest.mark.cases(0)
def test_an_arbitrary_record_is_said_to_be_one():
    estimates, said = record_responses(recorded(periodic=False), RATE, 50)
    assert estimates[0].frequency_hz.size <= 50
    lines = estimates[0].frequency_hz.size
    assert said == f"local models of several widths, averaged, at {lines} frequencies"
    assert all(isinstance(one, ResponseEstimate) for one in estimates)


def test_a_first_period_that_has_not_settled_is_left_out_and_said():
    records = recorded()
    decay = 3.0 * np.exp(-TIME * 10)
    _, said = record_responses([(u, y + decay) for u, y in records], RATE, 50)
    assert "the first left out as not settled" in said
    assert "left out" not in record_responses(records, RATE, 50)[1]


@pytest.mark.parametrize("samples", [32, 97, 500])
def test_periods_are_found(samples):
    rng = np.random.default_rng(samples)
    one = rng.normal(size=samples)
    assert period(np.tile(one, 4) + 0.01 * rng.normal(size=4 * samples)) == samples
    assert period(np.tile(one, 3)[: int(2.4 * samples)]) == samples
    assert period(rng.normal(size=4 * samples)) is None
    assert period(np.arange(4.0 * samples)) is None
    smooth = np.sin(2 * np.pi * np.arange(8 * samples) / samples)
    assert period(smooth) == samples


def test_frequencies_are_taken_in_either_unit():
    values = np.array([[1, 2], [2, 3]])
    one, other = (
        Responses(omega=[1.0, 2.0], values=values),
        Responses(values=values, frequency_hz=[1.0, 2.0]),
    )
    np.testing.assert_allclose(other.omega, 2 * np.pi * one.omega)
    with pytest.raises(InputError, match="give the frequencies once"):
        Responses(omega=[1.0, 2.0], values=values, frequency_hz=[1.0, 2.0])
    with pytest.raises(InputError, match="give the frequencies once"):
        Responses(values=values)
    with pytest.raises(InputError, match=r"frequency_hz\[1\] = 2 .* Hz are not increasing"):
        Responses(values=np.ones((3, 2)), frequency_hz=[1.0, 2.0, 1.5])


def test_a_cover_of_regions_holds_the_plants_where_one_of_estimates_does_not():
    """Few noisy periods: sets about the estimates miss true plants, sets about regions do not."""
    estimates, _ = record_responses(recorded(3, noise=0.1), RATE, 60)
    noisy = Responses.from_estimates(estimates).within(2, 40)
    known = Responses(omega=noisy.omega, values=truth(noisy.frequency_hz))
    plain, sure = (
        solve(CircleCover(noisy, 2, complex_order=2, confidence=c), method="steps")
        for c in (None, 0.99)
    )
    assert plain.certificate.valid and sure.certificate.valid
    assert contains(sure.answer.model, known)
    assert contains(sure.answer.model, noisy)
    task = CircleCover(noisy, 2, complex_order=2, confidence=0.99)
    metrics = task.metrics(sure.answer)
    assert 0.0 < metrics["noise_share"] < 1.0
    assert metrics["radius_rms_estimates"] < metrics["radius_rms"]
    check = next(c for c in sure.certificate.checks if c.name == "containment")
    assert "each with probability 0.99" in check.statement
    assert "for the 99 % regions of these plants" in check.over
    back = task.from_dataset(task.to_dataset(sure.answer))
    assert task.certify(back, 1e-3, optimal=False).valid


def test_without_noise_regions_are_points(folder):
    exact = Responses(
        omega=[1.0, 2.0, 3.0], values=np.array([[1, 2], [2, 3], [3, 4]]), variance=0.0
    )
    corners = with_regions(exact, 0.95).values.reshape(3, 2, -1)
    np.testing.assert_allclose(corners, np.broadcast_to(exact.values[..., None], corners.shape))


def test_polygons_contain_their_discs():
    one = Responses(omega=[1.0, 2.0], values=np.array([[1, 2], [2, 3]]), variance=0.01, degrees=10)
    radius = region_radius(one, 0.95)
    corners = with_regions(one, 0.95).values.reshape(2, 2, -1) - one.values[..., None]
    edge = (corners + np.roll(corners, -1, axis=-1)) / 2
    np.testing.assert_allclose(np.abs(edge).min(axis=-1), radius)


def test_noise_that_hides_a_plant_is_warned_of():
    noisy = Responses(
        values=np.array([[1, 2], [0.1, 3], [1, 1]]), frequency_hz=[1, 2, 3], variance=0.1
    )
    with pytest.warns(IdentificationWarning, match=r"1 of 3 frequencies, from 2 to 2 Hz"):
        with_regions(noisy, 0.95)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with_regions(
            Responses(omega=[1.0, 2.0], values=np.array([[1, 2], [1, 3]]), variance=0.1), 0.95
        )


def test_channels_of_several_are_chosen_by_name_or_number():
    response = np.arange(1, 13).reshape(2, 2, 3) * (1 + 1j)
    many = [control.frd(k * response, [1.0, 2.0, 3.0], outputs=["a", "b"]) for k in (1, 2)]
    by_name = Responses.from_frd(many, input="u[1]", output="b")
    np.testing.assert_array_equal(by_name.values[:, 0], response[1, 1])
    np.testing.assert_array_equal(
        Responses.from_frd(many, input=1, output=1).values, by_name.values
    )
    with pytest.raises(InputError, match="plant 1 has 2 outputs, a, b: choose one, output="):
        Responses.from_frd(many)
    with pytest.raises(UnknownNameError, match="no output is called 'c'; known: a, b"):
        Responses.from_frd(many, input=0, output="c")
    with pytest.raises(InputError, match="no input 7; plant 1 has 2, from 0"):
        Responses.from_frd(many, input=7, output=0)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda d: Responses.from_files(d / "x*.csv", input="a", output="b", time="t"),
         r"no file fits '.*x\*.csv'; the folder .*: it holds drive1.csv"),
        (lambda d: Responses.from_files(d / "no" / "*", input="a", output="b", time="t"),
         "the folder .*no': is missing"),
        (lambda d: read(d, output="sped"), "drive1.csv.*sped.*speed"),
        (lambda d: read(d, output=None), "of a record name input="),
        (lambda d: read(d, frequency="t", response="speed"), "of a record name input="),
        (lambda d: read(d, dt=1e-3), "either dt or the name of the time"),
        (lambda d: read(d, output="day"), "'2026-01-01' is not a number"),
        (lambda d: read(d, time="torque"), "'torque' is in 'Nm': 'Nm' cannot be converted to 's'"),
        (lambda d: Responses.from_files(d / "*", frequency="t", response="speed", hold=True),
         "hold belongs to records"),
        (lambda d: read(d, most=1), "most is 1; two frequencies"),
        (lambda d: Responses.from_files([d / "drive1.csv"], **NAMES), "is the only file"),
        (lambda d: Responses.from_files([d / "drive1.csv"] * 2, **NAMES), "two plants are called"),
        (lambda d: read(d, plants=["a"]), "1 names for 6 plants"),
        (lambda d: StadiumCover(read(d), 2, confidence=1.0), "must lie between 0 and 1"),
        (lambda d: StadiumCover(read(d), 2, confidence=0.9, leave_out=1), "give one"),
    ],
)  # fmt: skip
def test_refused(folder, ask, words):
    with pytest.raises(InputError, match=words):
        ask(folder)


def test_a_bad_record_is_named(folder, tmp_path):
    for k in (1, 2):
        lines = (folder / f"drive{k}.csv").read_text().splitlines()
        if k == 2:
            lines = [
                ",".join([*line.split(",")[:2], "1.5", *line.split(",")[3:]]) for line in lines
            ]
            lines[1] = "t,torque,speed,day,"
            lines[2] = "s,Nm,rad/s,-,"
        (tmp_path / f"drive{k}.csv").write_text("\n".join(lines))
    with pytest.raises(
        InputError, match=r"drive2.csv: the output 'speed' never changes, it is 1.5 in"
    ):
        read(tmp_path)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"values": [control.frd([1.0, 2.0], [1.0, 2.0])] * 2}, "Responses.from_frd"),
        ({"variance": -1.0}, "variance of plant 1 is -1.0 at 1 Hz"),
        ({"variance": np.ones((3, 3))}, r"variance of shape \(3, 3\) does not fit"),
        ({"variance": 1.0, "degrees": 0}, "degrees is 0; it must be positive"),
        ({"plants": ["a", "a"]}, "two plants are called 'a'"),
        ({"values": None}, "values are needed"),
    ],
)
def test_data_that_are_refused(given, words):
    whole = {"values": np.array([[1, 2], [2, 3]]), "frequency_hz": [1.0, 2.0]} | given
    with pytest.raises(InputError, match=words):
        Responses(**whole)


def test_responses_without_variance_have_no_regions():
    plain = Responses(omega=[1.0, 2.0], values=np.array([[1, 2], [2, 3]]))
    with pytest.raises(InputError, match="the responses have no variance"):
        StadiumCover(plain, 1, confidence=0.9)
    with pytest.raises(InputError, match="0 frequencies lie from 5 to 6 Hz"):
        plain.within(5, 6)
    with pytest.raises(InputError, match="one plant has no spread"):
        Responses.from_frd(control.frd([1.0, 2.0], [1.0, 2.0]))


def test_an_empty_list_of_files_is_refused():
    with pytest.raises(InputError, match="the list of files is empty"):
        Responses.from_files([], input="u", output="y", time="t")
