"""What fits where a linear system is wanted, and what is refused there."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.certify import certified_norm, stability_check
from workbench.errors import InputError
from workbench.mu import conditions
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.structure import Full
from workbench.synthesis import (
    HinfSynthesis,
    LoopShaping,
    MuSynthesis,
    approximate,
    discretise,
    dropout_modes,
    export,
    filtering_modes,
    load_controller,
    reduce_order,
    sampled_conditions,
    second_order_sections,
    unswitched_modes,
)
from workbench.uncertainty import Responses, StadiumCover, UncertaintyModel, generalised_plant

OMEGA = np.geomspace(1.0, 1e3, 40)
PERIOD = 1e-3


def measured() -> Responses:
    """Five second-order plants that differ in gain and damping."""
    rng = np.random.default_rng(7)
    s = 1j * OMEGA[:, None]
    gain, damping = 1 + 0.1 * rng.normal(size=5), 3 + 0.5 * rng.normal(size=5)
    return Responses(omega=OMEGA, values=gain * 100 / (s**2 + damping * s + 100))


@pytest.fixture(scope="module")
def cover():
    return solve(StadiumCover(measured(), order=2, complex_order=1, real_order=1))


def weighted(model):
    """The model with a weight of its error and one of its control."""
    error = control.tf([0.5, 10], [1, 0.01], inputs="e", outputs="z_e")
    return generalised_plant(
        [model, error, (0.01, "u", "z_u")],
        {"e": "r - f"},
        exogenous="r",
        control="u",
        performance=["z_e", "z_u"],
        measurement="e",
    )


@pytest.fixture(scope="module")
def plant(cover):
    return weighted(cover)


@pytest.fixture(scope="module")
def design(plant):
    return solve(MuSynthesis(plant))


def test_a_solution_is_a_block_as_its_answer_and_its_model_are(cover, plant):
    assert plant.structure == cover.answer.model.structure
    for same in (cover.answer, cover.answer.model):
        np.testing.assert_array_equal(weighted(same).system.A, plant.system.A)


@pytest.mark.cases(0)
def test_names_and_sampling_time_are_kept_all_the_way(tmp_path, plant, design):
    assert design.answer.K.input_labels == ["e"] and design.answer.K.output_labels == ["u"]
    less = approximate(design, 3, plant=plant)
    sampled = discretise(less, PERIOD, plant=plant)
    export(sampled, tmp_path / "k.json", "json")
    found, _ = load_controller(tmp_path / "k.json")
    for K in (less, sampled, found):
        assert (K.input_labels, K.output_labels) == (["e"], ["u"])
    assert sampled.dt == found.dt == PERIOD
    loop = generalised_plant([discretise(design, PERIOD)], {}, exogenous="e", performance="u")
    assert loop.system.dt == PERIOD


@pytest.mark.cases(0)
def test_a_controller_is_taken_as_solution_answer_and_system(plant, design):
    expected = conditions(plant, design.answer.K).robust_performance.upper
    for K in (design, design.answer):
        assert conditions(plant, K).robust_performance.upper == expected
    tried = reduce_order(plant, design, target=2 * expected)
    assert conditions(plant, tried).robust_performance.upper <= 2 * expected
    sections = second_order_sections(discretise(design, PERIOD))
    assert sampled_conditions(plant, sections, PERIOD).stable


def test_a_number_and_an_array_are_gains(plant):
    one, other = (conditions(plant, K).robust_performance for K in (0.1, np.array([[0.1]])))
    whole = conditions(plant, control.ss([], [], [], 0.1)).robust_performance
    assert one.upper == other.upper == whole.upper


@pytest.mark.cases(0)
def test_the_signs_are_those_of_the_sums_in_a_generalised_plant(cover, plant, design):
    K = discretise(design, PERIOD, plant=plant)
    inside = sampled_conditions(plant, K, PERIOD, delay_samples=1.0)
    outside = sampled_conditions(
        cover, K, PERIOD, delay_samples=1.0
    )  # u = -K y, as in control.feedback
    assert inside.stable and outside.stable
    assert inside.margins[0].phase_deg == pytest.approx(outside.margins[0].phase_deg, rel=1e-9)
    with pytest.raises(InputError, match="has its signs in its sums"):
        sampled_conditions(plant, K, PERIOD, sign=1)
    with pytest.raises(InputError, match="with the other sign, u = -K y, it is stable"):
        discretise(design, PERIOD, plant=cover, sign=1)


def test_two_uncertain_blocks_have_perturbations_of_their_own(cover):
    both = generalised_plant(
        [(cover, "u1", "f1"), (cover, "u2", "f2")], {}, exogenous=("u1", "u2"), performance=("f1",)
    )
    assert both.system.input_labels == ["u_r", "u_c", "u_r#2", "u_c#2", "u1", "u2"]
    assert len(both.structure) == 4


def test_an_uncertain_block_need_not_be_square():
    names = {"inputs": ["w", "w2", "u"], "outputs": ["z", "y"]}
    given = control.ss([[-1.0]], [[1.0, 2.0, 3.0]], [[1.0], [1.0]], np.zeros((2, 3)), **names)
    plant = generalised_plant(
        [given],
        {},
        perturbation=[(Full(2, 1), "z", ("w", "w2"))],
        exogenous="u",
        performance="y",
    )
    assert (plant.structure.rows, plant.structure.columns) == (2, 1)


def test_loop_shaping_hands_on_the_controller_of_the_users_plant():
    G = control.tf([1.0], [1.0, 1.0, 0.0], inputs="force", outputs="place")
    shaping = LoopShaping(G, W1=control.tf([10.0, 1.0], [1.0, 0.0]))
    found = solve(shaping)
    K = discretise(found, PERIOD, plant=G)
    assert K.nstates == found.answer.K.nstates + 1
    assert (K.input_labels, K.output_labels) == (["place"], ["force"])
    back = shaping.from_dataset(shaping.to_dataset(found.answer))
    np.testing.assert_array_equal(back.lti.A, found.answer.lti.A)


def test_an_answer_without_a_valid_certificate_is_refused(plant):
    stopped = solve(HinfSynthesis(plant.nominal(), gamma=1e-6))
    assert stopped.outcome is not Outcome.SOLVED
    with pytest.raises(InputError, match="no certified answer to go on with"):
        conditions(plant, stopped)


def test_an_answer_whose_certificate_fails_is_refused(plant, design):
    wrong = MuSynthesis(plant, target=design.answer.upper / 2)
    certificate = wrong.certify(design.answer, 1e-6, optimal=False)
    assert not certificate.valid
    with pytest.raises(InputError, match=r"certificate does not hold.*take `.answer`"):
        conditions(plant, replace(design, certificate=certificate))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("G", "not str$"),
        (None, "not NoneType$"),
        (control.frd([1.0, 2.0], [1.0, 2.0]), "fit a model or a cover to it first"),
        (measured(), "fit a model or a cover to it first"),
        (StadiumCover(measured(), order=2), "is a question: solve it first"),
        (UncertaintyModel, "is a class, give one of its objects"),
        (np.array([[np.nan]]), "finite numbers"),
        (np.zeros((2, 2, 2)), "finite numbers"),
        ([[1.0], [1.0, 2.0]], "rows alike"),
        (np.array([[1j]]), "real numbers"),
        (True, "not bool$"),
        (float("inf"), "finite numbers"),
    ],
)
def test_what_is_no_system_is_refused_with_what_to_do(plant, given, message):
    for ask in (
        lambda: conditions(plant, given),
        lambda: generalised_plant([(given, "a", "b")], {}, exogenous="a", performance="b"),
        lambda: sampled_conditions(given, 0.1, PERIOD),
    ):
        with pytest.raises(InputError, match=message):
            ask()


def test_a_block_of_two_is_no_block():
    with pytest.raises(InputError, match=r"block 1 is a tuple of 2; \(system, inputs, outputs\)"):
        generalised_plant([(1.0, "a")], {}, exogenous="a", performance="b")


@pytest.mark.parametrize("dt", [None, 0.1])
def test_a_system_of_scipy_is_refused_with_the_way_out(dt):
    import scipy.signal

    given = scipy.signal.TransferFunction([1.0], [1.0, 0.5], **({} if dt is None else {"dt": dt}))
    with pytest.raises(InputError, match=r"control\.ss\(s\.A, .*\)") as told:
        certified_norm(given)
    s = given.to_ss()
    way = str(told.value).partition("and ")[2]
    found = eval(way, {"control": control, "s": s})
    assert certified_norm(found) == pytest.approx(2.0, rel=1e-3)


def test_what_certifies_takes_any_linear_system():
    G = control.tf([3.0], [1.0, 1.0])
    assert certified_norm(G) == pytest.approx(3.0, rel=1e-3)
    assert stability_check(G).holds
    assert not stability_check(control.tf([1.0, -1.0], [1.0, 0.0, -1.0])).holds  # 1 / (s + 1)
    K = discretise(control.tf([1.0, 1.0], [1.0, 0.01]), 0.1)
    for modes in (dropout_modes, unswitched_modes):
        with pytest.raises(InputError, match="coupled"):
            modes(control.tf([1.0, 0.1], [1.0, -1.5, 0.56], 0.1))
    F = control.tf([0.5], [1.0, -0.5], 0.1)
    both = [filtering_modes(K, one) for one in (F, control.ss(F))]
    assert np.array_equal(both[0][1].A, both[1][1].A)
