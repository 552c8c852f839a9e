"""Stated deviations of models, judged on the plants by which regions of responses are judged."""

import numpy as np
import pytest
from scipy.signal import lfilter

from problems.bench.regions.design import Case
from problems.bench.regions.judged import records, truth
from problems.bench.regions.plants import PLANTS
from problems.bench.regions.records import EXCITATIONS
from workbench import Options, solve
from workbench.executor import Context
from workbench.identification import ClosedLoopFit, StateSpaceFit, closed_loop_covariance
from workbench.solution import ask

MODELLED = {
    "lag": (1, 1350, "prbs"),
    "two tanks": (3, 1300, "noise"),
    "fast lag": (2, 600, "prbs"),
    "damping 0.1": (2, 1000, "prbs"),
    "damping 0.03": (3, 1500, "noise"),
    "damping 0.01": (2, 1500, "noise"),
    "close pair": (4, 2000, "noise"),
    "zero to the right": (2, 1200, "prbs"),
    "two inputs": (4, 1500, "noise"),
}
"""Order of the sampled plant, samples and excitation; two thirds of a record are estimated from."""
OF_AN_INTEGRATOR = {"integrator": (2, 1500, "prbs")}
"""As above; only methods whose predictors need not have the plant's poles have answers."""
OF_A_CHANNEL = {"two inputs": 3}
"""Order of a plant of several inputs for Box-Jenkins, which has a polynomial for each."""
NOISE = {"prediction-error": 0.0, "box-jenkins": 0.8}
"""Factor of the noise from sample to sample, of the methods whose model of the noise holds it."""
DRIVEN = {
    "lag": (1, 0.5),
    "damping 0.1": (2, 0.1),
    "zero to the right": (2, 0.2),
    "integrator": (2, 0.2),
}
"""Order of the plant, and gain of the controller that closes its loop."""
NOISE_STATES = {"two-stage": 0, "instrumental-variables": 0, "indirect": 0, "direct": 1}
"""States of the noise, of which the direct method has a model, by the methods for loops."""
SIZE = 0.1
"""Standard deviation of the noise over that of the output without it."""
PLACES = 7
"""Frequencies of a case."""
PERIOD, PERIODS = 100, 30
"""Samples of a period of what drives a loop, and periods of a record."""
LEAST, LEAST_OF_A_CASE = 0.93, 0.88
"""Coverage of bands of 1.96 standard deviations: over all, and the upper end of a case's 99 %."""


def band(name):
    low, high = PLANTS[name].band
    return np.geomspace(low, 0.8 * high, PLACES)


def record(name, seed, colour):
    """A plant that runs already when the record begins: u (N, inputs), y (N,)."""
    _, samples, excitation = (MODELLED | OF_AN_INTEGRATOR)[name]
    plant, rng = PLANTS[name], np.random.default_rng(seed)
    made = EXCITATIONS[excitation]
    u = np.array([made(rng, 2 * samples, plant.band) for _ in plant.channels])
    clean = plant.output(u)[samples:]
    noise = lfilter([1.0], [1.0, -colour], rng.standard_normal(samples + 300))[300:]
    return u.T[samples:], clean + SIZE * clean.std() / noise.std() * noise


def held(name, method, seed):
    """At which frequencies, and for which inputs, the band of the magnitude holds the true one."""
    channels, at, order = PLANTS[name].channels, band(name), MODELLED[name][0]
    if method == "box-jenkins":
        order = OF_A_CHANNEL.get(name, order)
    delays = [int(channel.delay) for channel in channels]
    u, y = record(name, seed, NOISE[method])
    program = StateSpaceFit(u, y, orders=(order,), direct=False, delay_samples=delays)
    answer = solve(program, method=method).answer
    found = np.abs(answer.simulator.response(at)[:, 0])
    exact = np.abs(np.transpose([channel.response(at) for channel in channels]))
    return np.abs(found - exact) <= 1.96 * program.deviations(answer, at)[:, 0]


def driven(name, seed, size=SIZE):
    """Excitation, input and output of a plant in a loop u = r - gain y, with slow noise.

    The noise is so large beside the output of the loop without it: that of an open integrator is a
    ramp, beside which any noise seems small.
    """
    above, below = PLANTS[name].channels[0].polynomials()
    gain, rng, before = DRIVEN[name][1], np.random.default_rng(seed), 5 * PERIOD
    r = np.tile(rng.choice([-1.0, 1.0], PERIOD // 4).repeat(4), PERIODS + 5)
    v = lfilter([1.0], [1.0, -0.8], rng.standard_normal(len(r)))
    loop = below + gain * np.pad(above, (0, len(below) - len(above)))
    clean = lfilter(above, loop, r)
    y = clean + lfilter(below, loop, size * clean[before:].std() / v.std() * v)
    return r[before:], (r - gain * y)[before:], y[before:]


def held_in_a_loop(name, seed, methods=NOISE_STATES):
    """Of each method the frequencies at which the band of the magnitude holds the true one.

    ``methods`` are the states beside those of the plant, by the method.
    """
    import control

    order, gain = DRIVEN[name]
    at = np.unique(np.geomspace(1, 0.8 * PLANTS[name].band[1] * PERIOD, PLACES).round()) / PERIOD
    r, u, y = driven(name, seed)
    controller = control.ss([], [], [], [[gain]], 1.0)
    exact, found = np.abs(PLANTS[name].channels[0].response(at)), []
    for method, states in methods.items():
        program = ClosedLoopFit(
            u,
            y,
            orders=(order + states,),
            direct=False,
            excitation=r,
            controller=controller,
            period_samples=PERIOD,
        )
        model = solve(program, method=method).answer.simulator
        response = model.response(at)[:, 0, 0]
        covariance = closed_loop_covariance(program, method, model, at)[:, 0, 0]
        outward = np.stack([response.real, response.imag], axis=-1) / np.abs(response)[:, None]
        deviation = np.sqrt(np.einsum("fa,fab,fb->f", outward, covariance, outward))
        found.append(np.abs(np.abs(response) - exact) <= 1.96 * deviation)
    return found


def coverage(records):
    """Coverage of records (R, ...), which are independent, and the upper end of its 99 %."""
    shares = np.asarray(records).reshape(len(records), -1).mean(axis=1)
    return shares.mean(), shares.mean() + 2.576 * shares.std(ddof=1) / np.sqrt(len(shares))


@pytest.mark.slow
def test_bands_of_open_loops_hold_the_truth_in_a_hundred_records():
    found = [
        coverage([held(name, method, [k, 5, place]) for k in range(100)])
        for place, name in enumerate(MODELLED)
        for method in NOISE
    ]
    assert np.mean([share for share, _ in found]) >= LEAST
    assert min(end for _, end in found) >= LEAST_OF_A_CASE


def held_about_friction(order, count, seed):
    """At which frequencies bands hold the magnitude of the best linear approximation."""
    case = Case("friction", PLANTS["friction"], "noise", PLANTS["friction"].short, 40.0, 0.0)
    at, found = band("friction"), []
    exact = np.abs(truth(case, at)[:, 0])
    inputs, outputs, _ = records(case, count, seed)
    for u, y in zip(inputs, outputs, strict=True):
        program = StateSpaceFit(u[0], y, orders=(order,), direct=False)
        answer = ask(program, "prediction-error", Context(options=Options())).answer
        deviations = program.deviations(answer, at)[:, 0, 0]
        magnitude = np.abs(answer.simulator.response(at)[:, 0, 0])
        found.append(np.abs(magnitude - exact) <= 1.96 * deviations)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_bands_about_a_motor_with_mild_friction_hold(order):
    """They held 0.60 to 0.83 before the errors' dependence on the outputs was tested."""
    found = held_about_friction(order, 100, 20261131)
    assert found.mean() >= LEAST
    thirds = np.array_split(found, 3, axis=1)
    assert min(coverage(third)[1] for third in thirds) >= LEAST_OF_A_CASE


@pytest.mark.cases(0)
def test_bands_count_the_distortion_of_one_record():
    assert held_about_friction(1, 5, 7).mean() >= 0.8


@pytest.mark.slow
def test_bands_of_closed_loops_hold_the_truth_in_a_hundred_records():
    found = [
        coverage([held_in_a_loop(name, [k, 6, place]) for k in range(100)])
        for place, name in enumerate(DRIVEN)
    ]
    assert np.mean([share for share, _ in found]) >= LEAST
    assert min(end for _, end in found) >= LEAST_OF_A_CASE


@pytest.mark.cases(0)
@pytest.mark.parametrize(("name", "states"), [("integrator", 1), ("lag", 0)])
def test_bands_of_the_direct_method_hold_in_a_loop(name, states):
    """About an integrator they held 0.56 to 0.64: searches stopped at poles on the unit circle.

    With too few states for the noise feedback biases the plant, and the deviations are infinite.
    """
    shares = [held_in_a_loop(name, [k, 13], {"direct": states}) for k in range(8)]
    assert np.mean(shares) >= 0.75


@pytest.mark.cases(0)
def test_bands_do_not_trust_noise_that_a_short_record_hardly_shows():
    """A model of the noise with the plant's slow poles seems to tell that there is none."""
    shares = [held("zero to the right", "prediction-error", [k, 7]) for k in range(12)]
    assert np.mean(shares) >= 0.85


@pytest.mark.cases(0)
def test_box_jenkins_leaves_the_plants_poles_to_the_plant():
    """From noise that starts at the poles of a resonance it came 3.8 deviations too low."""
    shares = [held("damping 0.03", "box-jenkins", [k, 8]) for k in range(8)]
    assert np.mean(shares) >= 0.75


@pytest.mark.cases(0)
def test_deviations_count_noise_that_a_record_tells_by_chance():
    """The curvature of one record says most where its estimate errs most: it held 0.88."""
    shares = [held("two inputs", "prediction-error", [k, 11]) for k in range(12)]
    assert np.mean(shares) >= 0.92


@pytest.mark.parametrize("method", ["output-error", "box-jenkins"])
def test_what_cannot_have_the_pole_of_an_integrator_says_so(method):
    u, y = record("integrator", [10, 43], 0.8)
    program = StateSpaceFit(u, y, orders=(2,), direct=False)
    answer = solve(program, method=method)
    if answer.answer is None:
        assert "take method prediction-error or armax" in str(answer)
    else:
        assert np.isinf(program.deviations(answer.answer, band("integrator"))).all()
