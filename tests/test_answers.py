"""One kind of answer: a number, what it quantifies over, and a certificate made when asked for."""

import dataclasses
import importlib
import inspect
import pickle

import control
import numpy as np
import pytest

import workbench as wb
from workbench import diagnosis, fitting, geometry, identification, mu, realisations, synthesis
from workbench.answer import Answer, ProgramAnswer
from workbench.certificate import Certificate
from workbench.errors import InputError, UnknownNameError
from workbench.structure import Complex, Real, Structure
from workbench.uncertainty import (
    CircleCover,
    GeneralisedPlant,
    LeastInflation,
    Responses,
    UncertaintyModel,
    append,
    contains,
    cover_front,
    cover_of_estimate,
    delay,
    dynamics,
    feedback,
    generalised_plant,
    least_inflation,
    real,
    tf,
)

STIFFNESS = real("k", 10, percent=40)
PARAMETRIC = tf([18], [1, 1.8, STIFFNESS])
LEAD = control.tf([0.4, 1.0], [0.02, 1.0])
CLOSED = feedback(PARAMETRIC * (1 + 0.2 * dynamics("d", 1, 1)) * LEAD, 1)
OF_PARAMETERS = feedback(PARAMETRIC * LEAD, 1)
N = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.1], [0.1, 0.5]], np.zeros((2, 2)))
BLOCKS = Structure([Complex(1), Complex(1)])
M = np.array([[0.5, 0.2j], [0.3, 0.4]])
MIXED = Structure([Real(1), Complex(1)])
TWO_LATE = append(tf([1], [1, 1]) * delay("late", 0.3, 0.3), tf([1], [1, 1]))
OSCILLATOR = control.ss(control.tf([0.5], [1.0, 0.2, 1.0]))
LAG, FAST = control.tf([1.0], [1.0, 0.1]), control.tf([1.0], [1.0, -0.1])
OMEGA = np.geomspace(0.1, 10.0, 30)


def plant(leak=0.01):
    """A lag with multiplicative uncertainty and a weighted error."""
    parts = [
        (control.tf([1.0], [1.0, 1.0]), "v", "y"),
        (control.tf([0.2], [1.0]), "u", "z"),
        (control.tf([0.4], [1.0, leak]), "e", "z_e"),
    ]
    return generalised_plant(
        parts,
        {"v": "u + d", "e": "r - y"},
        perturbation=[(Complex(1), "z", "d")],
        exogenous="r",
        performance="z_e",
        control="u",
        measurement="e",
    )


def residual():
    """A model with a fault and noise, and a residual generator of it."""
    system = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    model = diagnosis.FaultModel(system, faults=("f",), noise=("n",))
    return diagnosis.null_space_generator(model, poles=-2.0).Q, model


def loop_weights():
    numbers = np.array([[0.5, 0.4], [0.2, 0.3], [0.1, 0.1]])
    return synthesis.LoopWeights(*numbers, np.array([0.3 + 0j, 0.1j]))


def estimate():
    rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    exact = 3.0 / (2j * np.pi * frequency + 2.0)
    noise = 1e-3 * rng.standard_normal((60, 2)) @ [1, 1j]
    measured = identification.ResponseEstimate(
        frequency, (exact + noise)[:, None, None], np.full((60, 1, 1), 2e-6), np.inf
    )
    return identification.fit_rational_model(measured, orders=1, excess=1)


def measured_loop():
    """Responses of an integrator and a lag with their variances."""
    frequency = np.geomspace(0.01, 5, 40)
    s = 2j * np.pi * frequency
    exact = (2.0 / (s * (s + 1.0)))[:, None, None]
    return identification.ResponseEstimate(frequency, exact, 1e-4 * np.abs(exact) ** 2, np.inf)


def parameters():
    frequency = np.geomspace(0.1, 10, 20)
    exact = 3.0 / (2j * np.pi * frequency + 2.0)
    measured = identification.MeasuredResponse(
        lambda p, s: p["k"] / (s + p["a"]), frequency, exact, variance=np.full(20, 1e-6)
    )
    start = {name: identification.FittedParameter(1.0, lower=0.1) for name in "ka"}
    return identification.fit_parameters(measured, start)


GAIN = control.tf([2.0], [1.0])
STATIC = control.ss([[-0.01, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[1.0]])
ANSWERS = {
    "robust_stability": lambda: mu.robust_stability(CLOSED),
    "robust_stability of parameters": lambda: mu.robust_stability(OF_PARAMETERS, tolerance=1e-2),
    "robust_stability with decay": lambda: mu.robust_stability(
        OF_PARAMETERS, tolerance=1e-2, decay=0.5
    ),
    "robust_stability, sampled": lambda: mu.robust_stability(
        feedback(tf([0.2], [1, real("p", -0.5, plus_minus=0.2)], 0.1) * dynamics("d", 1, 1), 1)
    ),
    "robust_stability with dead time": lambda: mu.robust_stability(
        feedback(tf([5], [1, 1]) * (1 + 0.2 * dynamics("d", 1, 1)) * delay("late", 0.3, 0.3), 1),
        tolerance=1e-2,
    ),
    "robust_stability of a gain with dead time": lambda: mu.robust_stability(
        feedback(real("k", 5, percent=20) * tf([1], [1, 1]) * delay("late", 0.3, 0.3), 1),
        tolerance=1e-2,
    ),
    "robust_stability of a delay": lambda: mu.robust_stability(
        feedback(tf([5], [1, 1]) * delay("tau", 0.0, 1.0), 1), tolerance=1e-2
    ),
    "robust_stability without an element that counts": lambda: mu.robust_stability(
        feedback(tf([1], [1, 1]) * (STIFFNESS - STIFFNESS), 1)
    ),
    "robust_performance": lambda: mu.robust_performance(CLOSED, gain=3.0, tolerance=1e-2),
    "worst_case_gain": lambda: mu.worst_case_gain(CLOSED),
    "worst_case_gain of a matrix": lambda: mu.worst_case_gain(N, Structure([Complex(1)])),
    "peak": lambda: mu.peak(N, BLOCKS),
    "peak with a complex part": lambda: mu.peak(
        OSCILLATOR, Structure([Real(1)]), complex_part=0.05
    ),
    "peak in a band": lambda: mu.peak(N, BLOCKS, band=(0.1, 10.0)),
    "peak, sampled": lambda: mu.peak(OSCILLATOR.sample(0.1), Structure([Complex(1)])),
    "skewed_peak": lambda: mu.skewed_peak(N, BLOCKS, fixed=[0]),
    "frequency_sweep": lambda: mu.frequency_sweep(N, BLOCKS, omega=OMEGA),
    "upper_bound": lambda: mu.upper_bound(M, MIXED),
    "upper_bound of a batch": lambda: mu.upper_bound(np.stack([M, 2 * M]), MIXED),
    "lower_bound": lambda: mu.lower_bound(M, MIXED),
    "branch_and_bound": lambda: mu.branch_and_bound(M, MIXED, tolerance=0.01),
    "skew_bounds": lambda: mu.skew_bounds(M, MIXED, fixed=[0]),
    "conditions": lambda: mu.conditions(plant(), GAIN),
    "conditions, unstable": lambda: mu.conditions(plant(), -GAIN),
    "gain_room": lambda: mu.gain_room(plant(1.0), GAIN, tolerance=0.05),
    "loop_margins": lambda: mu.loop_margins(PARAMETRIC, LEAD, tolerance=1e-2),
    "loop_margins of a loop": lambda: mu.loop_margins(control.tf([25], [1, 10, 10, 10])),
    "loop_margins with a direct term": lambda: mu.loop_margins(
        control.ss(control.tf([-0.5, 1.0], [1.0, 2.0]))
    ),
    "loop_margins, sampled": lambda: mu.loop_margins(OSCILLATOR.sample(0.1)),
    "loop_margins, unstable": lambda: mu.loop_margins(control.tf([5], [1, 1, 1, 1])),
    "loop_margins with dead time": lambda: mu.loop_margins(
        tf([5], [1, 1]) * delay("late", 0.3, 0.3)
    ),
    "loop_margins, crossings with dead time": lambda: mu.loop_margins(TWO_LATE).classical[
        "input 1"
    ],
    "loop_margins, disk of channels with dead time": lambda: mu.loop_margins(
        TWO_LATE, tolerance=1e-2
    ).multiloop["inputs"],
    "loop_margins of data": lambda: mu.loop_margins(measured_loop()),
    "loop_margins of every plant": lambda: mu.loop_margins(
        PARAMETRIC, LEAD, tolerance=0.1
    ).every_plant["input"],
    "loop_margins, crossings": lambda: mu.loop_margins(control.tf([25], [1, 10, 10, 10])).classical[
        "loop"
    ],
    "loop_margins of data of one plant": lambda: mu.loop_margins(measured_loop()).classical["loop"],
    "nu_gap": lambda: mu.nu_gap(LAG, FAST),
    "coprime_margin": lambda: mu.coprime_margin(LAG, GAIN),
    "margin_sensitivity": lambda: mu.margin_sensitivity(CLOSED, tolerance=1e-2),
    "guaranteed_probability": lambda: mu.guaranteed_probability(
        OF_PARAMETERS, gain=0.67, width=0.1
    ),
    "h_infinity_norm": lambda: mu.h_infinity_norm(N),
    "linf_norm": lambda: mu.linf_norm(FAST),
    "linf_norm, infinite": lambda: mu.linf_norm(control.tf([1.0], [1.0, 0.0])),
    "h2_norm": lambda: mu.h2_norm(N),
    "h2_norm, unstable": lambda: mu.h2_norm(control.tf([1.0], [1.0, -1.0])),
    "gramians": lambda: realisations.gramians(N),
    "hankel_values": lambda: realisations.hankel_values(OSCILLATOR),
    "hankel_values, sampled": lambda: realisations.hankel_values(OSCILLATOR.sample(0.1)),
    "stable_part": lambda: realisations.stable_part(FAST * control.tf([1.0], [1.0, 3.0, 0.0])),
    "minimal": lambda: realisations.minimal_realisation(
        control.tf([1.0, 1.0, 0.0], [1.0, 4.0, 3.0, 0.0])
    ),
    "minimal already": lambda: realisations.minimal_realisation(OSCILLATOR),
    "approximated": lambda: synthesis.approximate(N, 1, method="balanced", output_weight=LAG),
    "gap_metric": lambda: synthesis.gap_metric(LAG, FAST),
    "hinf": lambda: synthesis.hinf(
        control.ss([[-1.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]),
        measurements=1,
        controls=1,
    ),
    "least_norm_in_box": lambda: synthesis.least_norm_in_box(
        GeneralisedPlant(
            control.ss(
                [[1.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
            ),
            None,
            1,
            1,
        ),
        [[-10.0]],
        [[10.0]],
    ),
    "reduce_order": lambda: synthesis.reduce_order(plant(), STATIC),
    "reduced controller": lambda: synthesis.reduce_order(plant(), STATIC).tried[0],
    "least_mu": lambda: synthesis.least_mu(loop_weights()),
    "largest_least_mu": lambda: synthesis.largest_least_mu(
        lambda omega: synthesis.LoopWeights(
            1 / np.hypot(omega, 0.1), 0.5 * omega, 0.1 + 0 * omega, 0j * omega
        ),
        OMEGA,
    ),
    "known_disturbance_bound": lambda: synthesis.known_disturbance_bound(
        generalised_plant(
            [(LAG, "v", "x")],
            {"v": "u + d", "y": "x + n"},
            exogenous=["d", "n"],
            performance=["x", "u"],
            control="u",
            measurement="y",
        ),
        [0.5, 1.0],
    ),
    "sampled_conditions": lambda: synthesis.sampled_conditions(
        control.tf([1.0], [1.0, 0.0]), control.tf([4.0], [1.0], 0.1), 0.1
    ),
    "sampled_robustness": lambda: synthesis.sampled_robustness(
        tf([1], [1, 1]) * (1 + 0.5 * dynamics("d", 1, 1)), control.tf([0.4], [1, -1], 0.2), 0.2
    ),
    "model_matching": lambda: diagnosis.model_matching(
        residual()[1], control.tf([1.0], [1.0, 1.0]), poles=-2.0
    ),
    "performance_index": lambda: diagnosis.performance_index(*residual(), band=(0.1, 1.0)),
    "smallest_circle": lambda: geometry.smallest_circle([0, 1, 1j]),
    "narrowest_stadium": lambda: geometry.narrowest_stadium([[0, 1, 1j], [0, 2, 1j]]),
    "smallest_area_stadium": lambda: geometry.smallest_area_stadium([0, 1, 1j]),
    "fit_magnitude": lambda: fitting.fit_magnitude(OMEGA, 1 / np.hypot(OMEGA, 1), order=1),
    "fit_response": lambda: fitting.fit_response(OMEGA, 3 / (1j * OMEGA + 2), order=1),
    "fit_rational_model": estimate,
    "fit_parameters": parameters,
    "cover_front": lambda: cover_front(
        Responses(omega=OMEGA, values=np.array([g / (1j * OMEGA + 1) for g in (0.9, 1.0, 1.1)]).T),
        orders=[1],
        shape="circle",
    ),
    "least_inflation": lambda: least_inflation(
        CircleCover(
            Responses(
                omega=OMEGA, values=np.array([g / (1j * OMEGA + 1) for g in (0.9, 1.0, 1.1)]).T
            ),
            order=0,
        )
    ),
    "cover_of_estimate": lambda: cover_of_estimate(estimate().uncertainty, 1),
}
EAGER = {"hinf", "fit_response", "fit_rational_model", "fit_parameters"}
"""Functions that refuse what their certificate does not confirm, and so make it at once."""
WITHOUT_NUMBER = {
    *("conditions", "conditions, unstable", "gain_room", "loop_margins"),
    *("loop_margins of a loop", "loop_margins of every plant", "loop_margins, crossings"),
    "loop_margins, crossings with dead time",
    *("loop_margins, sampled", "loop_margins, unstable", "loop_margins of data of one plant"),
    *("loop_margins with a direct term", "loop_margins with dead time"),
    "loop_margins of data",
    *("reduce_order", "sampled_conditions", "gramians"),
}
"""Answers of several numbers with names of their own."""
SPOILT = {"lower": 1.02, "upper": 0.98, "value": 0.98, "norm": 0.98, "radius": 0.98, "modulus": 1.1}
"""Fields and the factor that makes a claim of each too good."""


@pytest.fixture(scope="module")
def answers():
    """Answers of the functions, each computed once."""
    return {}


@pytest.fixture
def answer(answers, name):
    if name not in answers:
        answers[name] = ANSWERS[name]()
    return answers[name]


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_holds_and_says_over_what(answer, name):
    assert isinstance(answer, Answer)
    if name not in EAGER:
        assert "certificate" not in vars(answer)  # nobody asked
    assert isinstance(answer.certificate, Certificate)
    assert answer.holds, answer.certificate.failures
    assert any(check.over for check in answer.certificate.checks)
    assert answer.certificate is answer.certificate


@pytest.mark.parametrize("name", ANSWERS)
def test_a_second_party_agrees(answer, name):
    """By code and mathematics of its own: `test_second_party` asks the same of Programs."""
    assert any(check.opinion for check in answer.certificate.checks), answer.certificate


@pytest.mark.parametrize("name", ANSWERS)
def test_it_prints_a_few_lines_with_its_number(answer, name):
    if name in ("fit_magnitude", "fit_response", "approximated"):
        return  # a StateSpace prints as one
    text = repr(answer)
    assert type(answer).__name__ in text and "array(" not in text
    assert len(text.splitlines()) <= 12 and len(text) < 1400, text
    assert "certificate" in text.splitlines()[-1]


@pytest.mark.parametrize("name", [name for name in ANSWERS if name not in WITHOUT_NUMBER])
def test_it_has_a_value_or_bounds(answer, name):
    if hasattr(answer, "upper"):
        assert (np.asarray(answer.lower) <= answer.upper).all()
    else:
        assert np.isfinite(answer.value).all()


@pytest.mark.parametrize("name", ANSWERS)
def test_a_claim_that_is_too_good_fails(answer, name):
    """Each number made better than it is, with everything else as it was."""
    if not dataclasses.is_dataclass(answer):
        return
    for field in dataclasses.fields(answer):
        value = getattr(answer, field.name)
        numbers = field.name in SPOILT and not isinstance(value, dict)
        good = numbers and np.isfinite(value).all() and np.asarray(value).all()
        if good:
            below = mu.LowerBound | LeastInflation
            factor = 1.02 if isinstance(answer, below) else SPOILT[field.name]
            better = dataclasses.replace(answer, **{field.name: factor * value})
            assert not better.holds  # nobody checks it
            checker, tolerance, optimal = answer._checked_by
            better.with_checker(checker, gap_tolerance=tolerance, optimal=optimal)
            assert not better.holds, field.name


@pytest.mark.parametrize("name", ANSWERS)
def test_it_goes_to_another_process(answer, name):
    given = answer
    again = pickle.loads(pickle.dumps(given))
    assert type(again) is type(given) and repr(again) == repr(given)


@pytest.mark.parametrize(
    "name",
    [
        "peak",
        "peak with a complex part",
        "upper_bound",
        "smallest_circle",
        "skewed_peak",
        "robust_stability of parameters",
        "loop_margins with dead time",
    ],
)
def test_it_takes_its_checker_to_another_process(name):
    again = pickle.loads(pickle.dumps(ANSWERS[name]()))
    assert "certificate" not in vars(again)
    assert again.holds


def test_a_changed_answer_has_no_certificate():
    circle = geometry.smallest_circle([0, 1, 1j])
    assert circle.holds
    changed = dataclasses.replace(circle, radius=circle.radius * 2)
    assert changed.certificate is None and not changed.holds and np.isnan(changed.value)
    assert "made by hand" in repr(changed)


def test_a_failing_certificate_is_printed():
    margins = mu.loop_margins(control.tf([25], [1, 10, 10, 10])).classical["loop"]
    missed = dataclasses.replace(
        margins, phases_deg=margins.phases_deg[:0], delays=margins.delays[:0]
    )
    missed.with_checker(margins._checked_by[0])
    assert not missed.holds and "missed" in repr(missed)


def test_figures_of_answers():
    sweep = mu.frequency_sweep(N, BLOCKS, omega=OMEGA)
    figure = sweep.plot()
    assert figure.axes[0].get_xlabel() == "frequency [Hz]"
    with pytest.raises(UnknownNameError, match="figure"):
        sweep.plot("nothing")
    with pytest.raises(InputError, match="no figure of a NuGap"):
        mu.nu_gap(LAG, FAST).plot()


def test_bounds_of_several_matrices_are_drawn_and_those_of_one_are_not():
    for bound in (mu.upper_bound, mu.lower_bound):
        (panel,) = bound(np.stack([M, 2 * M]), MIXED).plot().axes
        (drawn,) = panel.get_lines()
        assert drawn.get_linestyle() == "None" and len(drawn.get_xdata()) == 2
        panel.figure.canvas.draw()
        assert all(float(place).is_integer() for place in panel.get_xticks())
        with pytest.raises(InputError, match="there is no figure"):
            bound(M, MIXED).plot()


def test_a_peak_and_a_margin_are_drawn_with_their_level():
    for answer in (mu.peak(N, BLOCKS), mu.robust_stability(CLOSED)):
        (panel,) = answer.plot().axes
        labels = panel.get_legend_handles_labels()[1]
        assert labels == ["upper bound", "lower bound", "at every frequency"]
    with pytest.raises(InputError, match="no figure of a StabilityMargin"):
        mu.robust_stability(OF_PARAMETERS, tolerance=1e-2).plot()


def test_what_is_contained_is_certified():
    responses = Responses(
        omega=OMEGA, values=np.array([g / (1j * OMEGA + 1) for g in (0.9, 1.0, 1.1)]).T
    )
    model = UncertaintyModel(control.tf([1.0], [1.0, 1.0]), control.tf([0.11], [1.0]))
    found = contains(model, responses)
    assert found.holds and found.certificate.holds and found.value == found.worst
    assert any(check.opinion for check in found.certificate.checks)
    narrow = UncertaintyModel(control.tf([1.0], [1.0, 1.0]), control.tf([0.09], [1.0]))
    assert not contains(narrow, responses).certificate.holds


def test_the_answer_of_a_solution_has_its_certificate():
    solution = wb.solve(geometry.SmallestCircle([0, 1, 1j]))
    assert solution.answer.certificate is solution.certificate
    assert solution.holds and solution.value == solution.answer.value
    assert "for this one set of 3 points" in repr(solution)


def test_a_fitted_system_is_a_state_space():
    system = fitting.fit_response(OMEGA, 3 / (1j * OMEGA + 2), order=1)
    assert isinstance(system, control.StateSpace) and system.value < 1e-6
    assert type(system * 2) is control.StateSpace
    assert system.plot().axes


ROOMS = ("geometry", "fitting", "mu", "realisations", "synthesis", "diagnosis", "uncertainty")
NOT_PROVEN = {"FittedParameter"}
"""Classes with bounds that are no answers."""


@pytest.mark.parametrize("room", ROOMS)
def test_every_class_with_bounds_is_an_answer(room):
    """A new function that proves bounds returns one."""
    package = importlib.import_module(f"workbench.{room}")
    for name in package.__all__:
        found = getattr(package, name)
        if not (inspect.isclass(found) and dataclasses.is_dataclass(found)) or name in NOT_PROVEN:
            continue
        names = {field.name for field in dataclasses.fields(found)}
        if {"lower", "upper"} <= names:
            assert issubclass(found, Answer), name


def test_answers_of_programs_have_the_number_of_their_program():
    assert issubclass(geometry.Circle, ProgramAnswer)
    assert np.isnan(geometry.Circle(np.array(0j), np.array(1.0)).value)
