"""Errors of diagnosis for unsuitable input, which name it."""

import math

import control
import numpy as np
import pytest
from workbench.plants.textbook.fault_examples import two_actuators, unstable_sensor

from workbench.certify.stability import stability_check
from workbench.diagnosis import (
    Clusters,
    DisturbedPlant,
    Estimator,
    FaultEstimation,
    FaultModel,
    KalmanEstimator,
    Noise,
    Requirement,
    Rotation,
    adaptive_alarm,
    attainable_structures,
    bounded_threshold,
    clean_level,
    confusion_matrix,
    cusum,
    cusum_threshold,
    detectability,
    detection,
    drop_detector,
    estimate,
    fault_detection,
    fault_isolation,
    glr,
    hysteresis,
    isolate,
    masking_inputs,
    matching_bound,
    model_matching,
    moving_rms,
    null_space_generator,
    observer_gain,
    placed_estimator,
    prototype_poles,
    quality_signal,
    quantile_threshold,
    residual_response,
    structure_matrix,
    unattainable_faults,
)
from workbench.errors import InputError, UnknownNameError
from workbench.simulation import play
from workbench.uncertainty import GeneralisedPlant, generalised_plant

NAN = math.nan
RAGGED = [[1.0], [1.0, 2.0]]


def refused(cases):
    """The parameters of a test, from {name: (call, words of its message)}."""
    return pytest.mark.parametrize(
        "call, words", [pytest.param(*case, id=name) for name, case in cases.items()]
    )


def system(dt=0.0):
    return control.ss(
        [[0.5, 0.0], [0.0, 0.2]] if dt else [[-1.0, 0.0], [0.0, -2.0]],
        np.eye(2),
        [[1.0, 1.0]],
        [[0.0, 0.0]],
        dt,
        inputs=["u", "f"],
        outputs=["y"],
    )


MODEL = FaultModel(system(), controls="u", faults="f")
TWO, UNSTABLE = two_actuators(), unstable_sensor()
REFERENCE = control.ss(-10 * np.eye(2), np.eye(2), 10 * np.eye(2), np.zeros((2, 2)))


@refused(
    {
        "name": (lambda: FaultModel(system(), controls="u", faults=(1,)), "no input is called 1"),
        "names": (lambda: FaultModel(system(), controls="u", faults=1), "faults are 1"),
        "no names": (lambda: FaultModel(system(), controls=None, faults="f"), "controls are None"),
        "R1 text": (lambda: MODEL.with_fault("a", "x"), "R1 of fault 'a' is 'x'"),
        "R1 complex": (lambda: MODEL.with_fault("a", [1j, 1]), "real numbers"),
        "R1 ragged": (lambda: MODEL.with_fault("a", RAGGED), "rows of one length"),
        "R2 text": (lambda: MODEL.with_fault("a", [1, 1], R2="q"), "R2 of fault 'a' is 'q'"),
        "no string": (lambda: MODEL.with_fault(3, [1, 1]), "it must be a string"),
        "actuator": (lambda: MODEL.with_actuator_faults(3), "no control is called 3"),
        "sensor": (lambda: MODEL.with_sensor_faults(0), "no output is called 0"),
        "dA text": (lambda: MODEL.with_multiplicative_fault("p", dA="ab"), "dA of p is 'ab'"),
        "omega": (lambda: MODEL.response(["f"], "a"), "omega is 'a'"),
        "omega NaN": (lambda: MODEL.response(["f"], NAN), "finite frequencies"),
        "string": (lambda: MODEL.response("f", [1.0]), "a list of names"),
        "test at text": (lambda: detectability(MODEL, omega="a"), "omega is 'a'"),
        "test at complex": (lambda: detectability(MODEL, omega=1j), "real numbers"),
        "decoupled": (lambda: detectability(MODEL, decoupled=[0]), "no input is called 0"),
        "decoupled None": (lambda: detectability(MODEL, decoupled=None), "names are None"),
        "masking": (lambda: masking_inputs(None, "f", ()), "must be a FaultModel"),
        "row short": (
            lambda: unattainable_faults(TWO, (True,)),
            r"row is \(True,\); it must be \(k,\)",
        ),
        "row of 2": (lambda: unattainable_faults(TWO, (2, 3)), "0 or 1 for each"),
        "structures at": (lambda: attainable_structures(TWO, omega="a"), "omega is 'a'"),
    }
)
def test_fault_models_and_detectability(call, words):
    with pytest.raises((InputError, UnknownNameError), match=words):
        call()


@refused(
    {
        "omega text": (lambda: fault_detection(MODEL, -1, omega="x"), "omega is 'x'"),
        "omega empty": (lambda: fault_detection(UNSTABLE, -1, omega=[]), "omega is empty"),
        "structure": (lambda: fault_isolation(TWO, RAGGED, -1), "rows of one length"),
        "names": (lambda: fault_isolation(TWO, [["f_u1", "f_u2"]], -1), "structure is"),
        "infeasible": (lambda: fault_isolation(UNSTABLE, np.eye(2), -1), "not attainable: f_u"),
        "no Q": (lambda: structure_matrix(None, TWO), "Q must be a StateSpace"),
        "generator": (
            lambda: structure_matrix(fault_isolation(TWO, np.eye(2), -1), TWO),
            "not ResidualGenerator",
        ),
        "no model": (lambda: residual_response(REFERENCE, None, [], [1.0]), "must be a FaultModel"),
        "basis of None": (lambda: null_space_generator(None, -1), "must be a FaultModel"),
        "basis, no fault": (
            lambda: null_space_generator(FaultModel(system(), controls=("u", "f")), -1),
            "the model has no fault",
        ),
        "bound at": (lambda: matching_bound(TWO, REFERENCE, REFERENCE, "a"), "omega is 'a'"),
        "bound of None": (lambda: matching_bound(TWO, None, REFERENCE, 1.0), "Q must be"),
        "bound, no model": (lambda: matching_bound(None, None, REFERENCE, 1.0), "a FaultModel"),
        "method": (lambda: model_matching(TWO, REFERENCE, -1.0, method=3), "name of a method"),
        "gamma": (lambda: model_matching(TWO, REFERENCE, -1.0, gamma=NAN), "gamma is nan"),
        "sampled reference": (
            lambda: model_matching(
                TWO, control.ss(0.5 * np.eye(2), np.eye(2), np.eye(2), 0 * np.eye(2), 0.1), -1.0
            ),
            "sampling time",
        ),
    }
)
def test_residual_generators(call, words):
    with pytest.raises((InputError, UnknownNameError), match=words):
        call()


LAG = control.tf([1.0], [1.0, 0.5])
PLANT = generalised_plant([(LAG, "d", "x")], {"y": "x + f"}, exogenous=["d", "f"], measurement="y")
SAMPLED = GeneralisedPlant(
    control.ss([[0.5]], [[1.0, 0.0]], [[1.0]], [[0.0, 1.0]], 0.1, inputs=["d", "f"], outputs=["y"]),
    None,
    0,
    1,
)


def wanted(*requirements):
    return FaultEstimation(PLANT, "f", requirements=list(requirements))


@refused(
    {
        "name": (lambda: Requirement(3, "f"), "name is 3; it must be a string"),
        **{
            f"band {band}": (lambda band=band: Requirement("a", "f", band=band), "the band of 'a'")
            for band in (None, (1,), (1, 2, 3), "ab", 3.0, (1j, 2), ("a", "b"), (NAN, 1))
        },
        "faults": (lambda: FaultEstimation(PLANT, 1.5), r"inputs 1\.5: give names, or numbers"),
        "one": (
            lambda: FaultEstimation(PLANT, "f", requirements=Requirement("a", "f")),
            "a list of Req",
        ),
        "tuple": (lambda: wanted(("a", "f")), "is no Requirement"),
        "names": (lambda: wanted(Requirement("a", "f"), Requirement("a", "d")), "of its own"),
        "taken": (lambda: wanted(Requirement("all together", "f")), "not 'all together'"),
        "integrator": (
            lambda: wanted(Requirement("a", "f", weight=control.tf([1.0], [1.0, 0.0]))),
            "the weight of 'a' is not stable",
        ),
        "sampled plant": (lambda: FaultEstimation(SAMPLED, "f"), r"sampled at 0\.1 s"),
        "sampled start": (
            lambda: FaultEstimation(PLANT, "f", start=control.tf([1.0], [1.0, 0.5], 0.1)),
            r"the start is sampled at 0\.1 s",
        ),
    }
)
def test_fault_estimation(call, words):
    with pytest.raises((InputError, UnknownNameError), match=words):
        call()


def test_a_pole_at_the_origin_is_not_stable():
    assert not stability_check(control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]])).holds
    assert stability_check(control.ss([], [], [], [[1.0]])).holds


DISC = control.ss([[0.9]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], 0.001)
BELIEVED = DisturbedPlant(DISC, Rotation(5.0))
KALMAN = KalmanEstimator(BELIEVED, Noise(0.1, 0.1, 0.1, 1.0))


@refused(
    {
        "model": (lambda: Estimator(None, np.zeros(3)), "must be a DisturbedPlant"),
        "gain": (lambda: Estimator(BELIEVED, RAGGED), "gain is"),
        "quality": (lambda: KALMAN.steady_state.poles(quality=2.0), "quality is 2"),
        "no plant": (lambda: DisturbedPlant(None, Rotation(5.0)), "the plant must be a StateSp"),
        "tf": (
            lambda: DisturbedPlant(control.tf([1], [1, 0.5], 0.1), Rotation(5.0)),
            "not TransferFunction",
        ),
        "rotation": (lambda: DisturbedPlant(DISC, 5.0), "must be a Rotation, not float"),
        "colour": (lambda: DisturbedPlant(DISC, Rotation(5.0), colour="a"), "the colour must be"),
        "no number": (lambda: Rotation("a"), "frequency_hz is 'a'"),
        "harmonics": (lambda: Rotation(5.0, harmonics=1), "harmonics are 1"),
        "range": (
            lambda: Rotation(5.0, harmonics=(1,), adaptation=1.0, range_hz=(1,)),
            "give two numbers",
        ),
        "rate": (lambda: Rotation(5.0, harmonics=(1,), adaptation="a"), "adaptation is 'a'"),
        "period": (lambda: Rotation(5.0).oscillators(0.0), "dt is 0"),
        "period NaN": (lambda: Rotation(5.0).poles(NAN, 1.0), "dt is nan"),
        "placed": (lambda: placed_estimator(None, [0.5]), "must be a DisturbedPlant"),
        "A": (lambda: observer_gain("a", [[1.0]], [-1.0]), "A is 'a'"),
        "poles": (lambda: observer_gain([[1.0]], [[1.0]], "a"), "poles is 'a'"),
        "sampling": (lambda: observer_gain([[1.0]], [[1.0]], [0.5], dt="a"), "dt is 'a'"),
        "noise": (lambda: KalmanEstimator(BELIEVED, 1.0), "noise must be a Noise"),
        "deviation": (lambda: Noise("a", 1, 1, 1), "known is 'a'"),
        "variance": (lambda: Noise(1e200, 1, 1, 1), "variances must be finite"),
        "no controller": (lambda: estimate(None, [1.0], [1.0], [1.0]), "must be a Controller"),
        "estimator": (lambda: estimate(KALMAN, [1.0], [1.0], [1.0]), "not KalmanEstimator"),
        "record": (lambda: estimate(KALMAN.controller, ["a"], [1.0], [1.0]), "measurement is"),
        "prototype": (lambda: prototype_poles([], 2, 1.0), "kind of prototype is"),
        "bandwidth": (lambda: prototype_poles("itae", 2, "a"), "bandwidth is 'a'"),
    }
)
def test_estimators(call, words):
    with pytest.raises(InputError, match=words):
        call()


NOISE = np.random.default_rng(0).standard_normal(500)
CLUSTERS = Clusters.fit(NOISE[:40].reshape(20, 2), [0] * 10 + [1] * 10, ["a", "b"])


@refused(
    {
        "text": (lambda: quantile_threshold("a", 0.1), "clean is 'a'"),
        "complex": (lambda: quantile_threshold(1j * NOISE, 0.1), "real numbers"),
        "rate": (lambda: quantile_threshold(NOISE, "a"), "false_alarm_rate is 'a'"),
        "block": (lambda: quantile_threshold(NOISE, 0.1, block=2.5), r"block is 2\.5"),
        "noise": (lambda: bounded_threshold([1], [1], noise="a"), "noise is 'a'"),
        "base": (lambda: adaptive_alarm("a", 1, 0.5), "base is 'a'"),
        "place": (lambda: adaptive_alarm(1, 1, 0.5, residual=-1), "residual is -1"),
        "on": (lambda: hysteresis("a", 0), "on is 'a'"),
        "drift": (lambda: cusum(None), "drift is None"),
        "signal": (lambda: cusum(0.1, signal=0.7), r"signal is 0\.7"),
        "run length": (lambda: cusum_threshold(math.inf, 1, 1), "run_length inf"),
        "huge drift": (lambda: cusum_threshold(1e6, 1e300, 1), "below that of a threshold of 0"),
        "window": (lambda: glr(2.5, 1), r"window is 2\.5"),
        "mean": (lambda: glr(3, 1, mean=NAN), "mean is nan"),
        "rms": (lambda: moving_rms(3, signals=0), "signals are 0"),
        "features": (lambda: CLUSTERS.distances("a"), "features is 'a'"),
        "names": (lambda: Clusters.fit([[1.0]], [0], None), "names are None"),
        "reject": (lambda: CLUSTERS.classify([[0.0, 0.0]], reject="a"), "reject is 'a'"),
        "kinds": (lambda: confusion_matrix([0], [0], "a"), "kinds is 'a'"),
        "found": (lambda: confusion_matrix([0], [0.5], 1), "whole numbers"),
        "fired": (lambda: isolate(np.eye(2, dtype=bool), [[True], [True, False]]), "one length"),
        "faults": (lambda: detection([0, 1], [(0, 1, 2)], 0.1), "first, one after the last"),
        "no pairs": (lambda: detection([0, 1], [0], 0.1), "first, one after the last"),
        "period": (lambda: detection([0, 1], [], "a"), "dt is 'a'"),
        "tail": (lambda: detection([0, 1], [(0, 1)], 0.1, tail=0.5), r"tail is 0\.5"),
        "level": (lambda: quality_signal(None, 0.1, 0.5), "level is None"),
        "dist": (lambda: quality_signal(1.0, "a", 0.5), "dist_min is 'a'"),
        "clean": (lambda: clean_level("a"), "the record is 'a'"),
        "binary": (lambda: drop_detector(1.0, below="a"), "below is 'a'"),
    }
)
def test_evaluation(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize(
    "controller",
    [
        cusum(0.1, signal=4),
        glr(3, 1.0, signal=4),
        hysteresis(1.0, 0.0, signal=4),
        moving_rms(3, signals=(0, 4)),
        adaptive_alarm(1.0, 1.0, 0.5, residual=4),
        quality_signal(1.0, 0.1, 0.5, signals=(1, 4)),
        KALMAN.controller,
    ],
    ids=["cusum", "glr", "hysteresis", "rms", "adaptive", "quality", "kalman"],
)
def test_no_controller_reads_measurements_that_are_not_there(controller):
    with pytest.raises(InputError, match=r"reads \d measurements; there are 2"):
        play(controller, np.ones((3, 2)))


def test_thresholds_of_the_least_drift_are_those_of_none():
    # run_length = b^2 without drift
    assert cusum_threshold(1e6, 1e-300, 1.0) == pytest.approx(1000.0 - 1.166)
