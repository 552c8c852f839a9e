"""The estimator of constant gain: its step, open loop, following of the rotation, bad input."""

import control
import numpy as np
import pytest
from estimator_plants import PERIOD, disturbed, lens, record
from hypothesis import given, settings
from hypothesis import strategies as st
from timing import least_seconds

from workbench.diagnosis import DisturbedPlant, Estimator, Rotation, estimate, placed_estimator
from workbench.errors import InputError
from workbench.simulation import play
from workbench.systems.sampling import respond


def designed(rotation=None, decay=8.0, **parts):
    """Bessel-like poles for the lens, oscillators that settle, the colour's poles moved a bit."""
    model = disturbed(rotation, **parts)
    poles = np.exp(np.array([-150 + 90j, -150 - 90j, -400]) * PERIOD)
    turning = model.rotation.poles(PERIOD, decay)
    colour = np.exp(np.array([-300.0, -340.0]) * PERIOD)[: model.slices[2].stop - model.seen + 2]
    colour = colour if model.colour is not None else []
    return placed_estimator(model, np.concatenate([poles, turning, colour]))


def reference(model, gain, y, u, quality):
    """The same recursion with whole matrices, for a constant rotation."""
    x, padded = np.zeros(len(model.A)), np.zeros(len(model.A))
    padded[: model.seen] = gain
    outputs, disturbance = [], []
    for k in range(len(y)):
        x = x + quality[k] * padded * (y[k] - model.C @ x)
        outputs.append(model.Z @ x)
        disturbance.append(model.disturbance @ x)
        x = model.A @ x + model.B * u[k]
    return np.array(outputs), np.array(disturbance)


@given(st.integers(0, 1000), st.booleans(), st.booleans(), st.integers(1, 3))
@settings(derandomize=True, deadline=None, max_examples=15)
def test_streaming_is_the_recursion_with_whole_matrices(seed, coloured, beside, harmonics):
    rng = np.random.default_rng(seed)
    model = disturbed(Rotation(5.0, harmonics=tuple(range(1, harmonics + 1))), coloured, beside)
    gain = 1e-3 * rng.standard_normal(model.seen)
    try:
        estimator = Estimator(model, gain)
    except InputError:  # a random gain may be unstable: make it nothing, which is not
        with pytest.raises(InputError, match="unstable"):
            Estimator(model, gain)
        estimator = designed(model.rotation, coloured=coloured, beside=beside)
    y, u, quality = rng.standard_normal((3, 60))
    quality = np.clip(abs(quality), 0.0, 1.0)
    found = estimate(estimator.controller, y, u, quality)
    outputs, disturbance = reference(estimator.model, estimator.gain, y, u, quality)
    np.testing.assert_allclose(found.outputs, outputs, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.disturbance, disturbance, rtol=1e-9, atol=1e-12)
    assert (found.frequency_hz == 5.0).all()


@given(st.floats(3.0, 30.0), st.floats(3.0, 30.0))
@settings(derandomize=True, deadline=None, max_examples=10)
def test_an_internal_model_leaves_no_error(frequency, decay):
    y, u, position, d = record(frequency, harmonics=(1.0, 0.4))
    estimator = designed(Rotation(frequency, harmonics=(1, 2)), decay)
    found = estimate(estimator.controller, y, u, np.ones(len(y)))
    late = slice(-200, None)
    assert abs(found.disturbance - d)[late].max() < 1e-3
    assert abs(found.outputs[:, 1] - position)[late].max() < 1e-3 * abs(position).max()


def test_at_quality_zero_it_goes_on_alone():
    y, u, position, d = record(samples=6000)
    quality = np.ones(len(y))
    quality[4000:4500] = 0.0
    y[4000:4500] = 1e3  # whatever a defect says
    found = estimate(designed().controller, y, u, quality)
    assert abs(found.disturbance - d)[4000:4500].max() < 1e-6
    assert abs(found.outputs[:, 1] - position)[4000:5000].max() < 1e-6 * abs(position).max()


def test_poles_at_a_quality_are_those_of_the_recursion():
    estimator, n = designed(), 5
    for quality in (0.0, 0.3, 1.0):
        # The error of a record of zeros, from a state, decays as the slowest of them.
        A, C = estimator.model.A[:n, :n], estimator.model.C[:n]
        one_sample = A @ (np.eye(n) - quality * np.outer(estimator.gain, C))
        late = np.linalg.matrix_power(one_sample, 4000)
        rate = abs(estimator.poles(quality=quality)).max() ** 4000
        assert 1e-3 < np.linalg.norm(late, 2) / rate < 1e6
    assert abs(estimator.poles(quality=0.0)).max() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("quality", [0.0, 0.4, 1.0])
def test_the_system_at_a_quality_is_what_streams(quality):
    estimator = designed(Rotation(5.0, harmonics=(1, 2)), coloured=True, beside=True)
    y, u = np.random.default_rng(3).standard_normal((2, 80))
    found = estimate(estimator.controller, y, u, np.full(80, quality))
    told = respond(estimator.system(quality=quality), np.column_stack([y, u]))
    np.testing.assert_allclose(told[:, :-1], found.outputs, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(told[:, -1], found.disturbance, rtol=1e-9, atol=1e-12)
    with pytest.raises(InputError, match="0 to 1"):
        estimator.system(quality=1.0 + quality + 1e-9)


def test_what_is_beside_follows_u_alone():
    model = disturbed(beside=True)
    y, u, _, _ = record(samples=300)
    estimator = designed(beside=True)
    found = estimate(estimator.controller, y, u, np.ones(300))
    _, motor = control.forced_response(model.unmeasured, inputs=u)
    np.testing.assert_allclose(found.outputs[:, 2], motor, atol=1e-12)


@pytest.mark.parametrize("start", [3.5, 4.75, 5.25, 7.0])
def test_the_rotation_is_found_from_far(start):
    y, u, _, d = record(samples=12_000)
    rotation = Rotation(start, adaptation=1.5, floor=0.01)
    found = estimate(designed(rotation).controller, y, u, np.ones(len(y)))
    assert found.frequency_hz[-1] == pytest.approx(5.0, rel=1e-4)
    assert abs(found.disturbance - d)[-500:].max() < 5e-3
    fixed = estimate(designed(Rotation(start)).controller, y, u, np.ones(len(y)))
    assert abs(fixed.disturbance - d)[-500:].max() > 0.05


@pytest.mark.parametrize("rate", [0.25, 0.5, 1.0])
def test_the_rotation_settles_at_the_stated_rate(rate):
    """Small errors obey e'' + a e' + a g e = 0; they decay with its slow root in the end."""
    decay = 8.0
    y, u, _, _ = record(samples=16_000)
    rotation = Rotation(5.02, adaptation=rate)
    found = estimate(designed(rotation, decay).controller, y, u, np.ones(len(y)))
    off = found.frequency_hz - 5.0
    per_turn = off[: 200 * (len(off) // 200)].reshape(-1, 200).mean(axis=1)
    late = slice(8, 25)
    fitted = -np.polyfit(0.2 * np.arange(len(per_turn))[late], np.log(abs(per_turn[late])), 1)[0]
    slow = (decay - np.sqrt(decay**2 - 4 * decay * rate)) / 2
    assert fitted == pytest.approx(slow, rel=0.15)


def test_noise_hardly_moves_the_rotation_and_its_range_holds_it():
    y, u, _, _ = record(samples=12_000, noise=0.05)
    rotation = Rotation(4.5, adaptation=0.5, floor=0.01)
    found = estimate(designed(rotation).controller, y, u, np.ones(len(y)))
    assert found.frequency_hz[-4000:].mean() == pytest.approx(5.0, rel=3e-3)
    narrow = Rotation(4.5, adaptation=0.5, range_hz=(4.0, 4.8))
    held = estimate(designed(narrow).controller, y, u, np.ones(len(y)))
    assert held.frequency_hz.max() <= 4.8 and held.frequency_hz.min() >= 4.0
    assert held.frequency_hz[-1] == pytest.approx(4.8, abs=0.1)


def test_nothing_that_turns_leaves_the_rotation_where_it_is():
    rotation = Rotation(5.0, adaptation=1.0, floor=0.1)
    found = estimate(designed(rotation).controller, *np.zeros((2, 500)), np.ones(500))
    assert (found.frequency_hz == 5.0).all()


def test_fifty_times_real_time_at_35_khz():
    rng = np.random.default_rng(0)
    y, u = rng.standard_normal((2, 35_000))
    controller = designed(coloured=True, beside=True).controller
    given = np.column_stack([y, u, np.ones(len(y))])
    play(controller, given[:10])
    assert least_seconds(lambda: play(controller, given), 15) < 1 / 50


def test_records_that_do_not_fit():
    controller, good = designed().controller, np.ones(20)
    with pytest.raises(InputError, match="shapes differ"):
        estimate(controller, good, good[:-1], good)
    with pytest.raises(InputError, match="input is not finite at sample 3"):
        estimate(controller, good, np.where(np.arange(20) == 3, np.nan, 1.0), good)
    with pytest.raises(InputError, match=r"quality is 1\.5 at sample 2"):
        estimate(controller, good, good, np.where(np.arange(20) == 2, 1.5, 1.0))
    outside = np.column_stack([good, good, np.where(np.arange(20) == 7, -0.1, 1.0)])
    with pytest.raises(InputError, match="not finite at sample 7"):
        play(controller, outside)


def test_estimators_that_are_none():
    model = disturbed()
    with pytest.raises(InputError, match=r"must be finite, \(5,\)"):
        Estimator(model, np.zeros(4))
    with pytest.raises(InputError, match="unstable"):
        Estimator(model, np.full(5, 3.0))


@pytest.mark.parametrize(
    "options, message",
    [
        ({"frequency_hz": 0.0}, "rotation frequency is 0"),
        ({"frequency_hz": np.nan}, "rotation frequency is nan"),
        ({"frequency_hz": 5.0, "harmonics": ()}, "harmonics"),
        ({"frequency_hz": 5.0, "harmonics": (1, 1)}, "harmonics"),
        ({"frequency_hz": 5.0, "harmonics": (1.5,)}, "harmonics"),
        ({"frequency_hz": 5.0, "harmonics": (2, 1), "adaptation": 1.0}, "put 1 in front"),
        ({"frequency_hz": 5.0, "adaptation": -1.0}, "adaptation is -1"),
        ({"frequency_hz": 5.0, "adaptation": 1.0, "range_hz": (6.0, 8.0)}, "range of the rotation"),
        ({"frequency_hz": 5.0, "floor": np.inf}, "floor inf"),
    ],
)
def test_rotations_that_are_none(options, message):
    with pytest.raises(InputError, match=message):
        Rotation(**options)


def test_models_that_are_none():
    with pytest.raises(InputError, match="harmonic 3 of up to 200"):
        disturbed(Rotation(200.0, harmonics=(1, 2, 3)))
    with pytest.raises(InputError, match="decay"):
        Rotation(5.0).poles(PERIOD, 0.0)
    plant = lens()
    with pytest.raises(InputError, match="plant is continuous"):
        DisturbedPlant(control.ss(-1.0, [[1.0, 1.0]], 1.0, 0.0), Rotation(5.0))
    with pytest.raises(InputError, match=r"colour has the sample time 0\.002 s, the plant 0\.001"):
        DisturbedPlant(plant, Rotation(5.0), colour=control.ss(0.5, 1.0, 1.0, 0.0, 2e-3))
    with pytest.raises(InputError, match="feedthrough"):
        DisturbedPlant(plant, Rotation(5.0), colour=control.ss(0.5, 1.0, 1.0, 1.0, PERIOD))
    with pytest.raises(InputError, match="unmeasured system must be stable"):
        DisturbedPlant(
            plant, Rotation(5.0), colour=None, unmeasured=control.ss(1.0, 1.0, 1.0, 0.0, PERIOD)
        )
    with pytest.raises(InputError, match="needs 2"):
        DisturbedPlant(plant[:, 0], Rotation(5.0))
    blind = control.ss(plant.A, plant.B * [[1.0, 0.0]], plant.C, 0.0, PERIOD)
    with pytest.raises(InputError, match=r"\(5 Hz\) does not show"):
        DisturbedPlant(blind, Rotation(5.0))
