"""What every entry of the room says to input that it cannot take, and to input that looks bad."""

from dataclasses import replace

import control
import numpy as np
import pytest
from plants import scalar_plant
from tables import each
from workbench.plants.textbook.first_order import unstable_first_order

from workbench import Outcome, solve
from workbench.errors import InputError, ResultError, SolverError, UnknownNameError
from workbench.structure import Complex, Full, Structure
from workbench.synthesis import (
    HinfSynthesis,
    LoopShaping,
    MixedSensitivity,
    MuSynthesis,
    approximate,
    discretise,
    export,
    hinf,
    load_controller,
    reduce_order,
    regularise,
    sampled_conditions,
    second_order_sections,
)
from workbench.synthesis.h_infinity.assumptions import checked
from workbench.synthesis.h_infinity.normalised import SingularPlantError
from workbench.systems.standard_plant import standard_plant
from workbench.uncertainty import GeneralisedPlant

S = control.tf("s")
G = 1 / (S + 1)
PLANT = scalar_plant(1.0)
UNCERTAIN = unstable_first_order()
K = hinf(UNCERTAIN).K
KD = control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.1)
NO_CONTROL = control.ss([], [], [], np.zeros((0, 0)))


def changed(system, **parts):
    dt = parts.pop("dt", system.dt)
    given = [np.array(parts.get(name, getattr(system, name)), float) for name in "ABCD"]
    return control.StateSpace(*given, dt, remove_useless_states=False)


def entry(matrix, value, *place):
    new = np.array(matrix, float)
    new[place] = value
    return new


def sampled(system):
    """Unstable in discrete time too, at z = 1.5 in place of s = 1."""
    return changed(system, A=[[1.5]], dt=0.1)


WRONG = [
    (float("nan"), "finite numbers"),
    (np.array([[1j]]), "real numbers"),
    (None, "not NoneType"),
    ("K", "not str"),
    (control.frd(G, [1.0, 2.0]), "not FrequencyResponseData"),
    (control.tf([1, 1, 1], [1, 1]), "improper.*short T"),
    (control.ss([[np.nan]], [[1.0]], [[1.0]], [[0.0]]), "A of .* not finite"),
    (control.ss([[-1.0]], [[1.0]], [[1.0]], [[np.inf]]), "D of .* not finite"),
    (NO_CONTROL, "0 inputs and 0 outputs"),
]
ENTRIES = {
    "G of mixed sensitivity": lambda one: MixedSensitivity(one, W_S=1.0, W_KS=1.0),
    "G of loop shaping": LoopShaping,
    "reduced": lambda one: approximate(one, 1, method="balanced"),
    "reduced hankel": lambda one: approximate(one, 1, method="hankel"),
    "reduced weighted": lambda one: approximate(one, 1, plant=UNCERTAIN),
    "reduce": lambda one: reduce_order(UNCERTAIN, one),
    "discretised": lambda one: discretise(one, 0.01),
    "sections": second_order_sections,
    "K of sampled conditions": lambda one: sampled_conditions(G, one, 0.1),
    "plant of sampled conditions": lambda one: sampled_conditions(one, KD, 0.1),
    "export json": lambda one: export(one, "never.json", "json"),
    "export mat": lambda one: export(one, "never.mat", "mat"),
    "export c": lambda one: export(one, "never.h", "c"),
}


@each("call", ENTRIES.values(), ids=ENTRIES)
@each(("wrong", "said"), WRONG)
def test_what_is_no_system(call, wrong, said):
    with pytest.raises(InputError, match=said):
        call(wrong)


@pytest.mark.parametrize(("wrong", "said"), WRONG[:2] + WRONG[3:])
def test_systems_that_may_be_left_out(wrong, said):
    with pytest.raises(InputError, match=said):
        discretise(K, 0.01, plant=wrong)
    with pytest.raises(InputError, match=f"start|{said}"):
        MuSynthesis(UNCERTAIN, start=wrong)
    if not isinstance(wrong, float):
        with pytest.raises(InputError, match=said):
            MixedSensitivity(G, W_S=wrong, W_KS=1.0)
        with pytest.raises(InputError, match=said):
            LoopShaping(G, W1=wrong)


# --- H-infinity, continuous and sampled ---------------------------------------------------------


@pytest.mark.parametrize("form", [lambda system: system, sampled], ids=["continuous", "sampled"])
class TestHinf:
    @pytest.mark.parametrize(
        ("parts", "said"),
        [
            ({"B": [[1.0, 0.0, 0.0]]}, r"not stabilisable.*mode (1|z = 1\.5)"),
            ({"C": [[1.0], [0.0], [0.0]]}, r"not detectable.*mode (1|z = 1\.5)"),
            ({"B": [[1.0, 0.0, 1e-310]]}, "not stabilisable"),
            ({"B": [[0.0, 0.0, 0.0]]}, r"unstable mode 1.*take it out"),
            ({"B": [[1.0, np.nan, 1.0]]}, "B of .*plant .*not finite"),
            ({"D": np.full((3, 3), np.inf)}, "D of .*plant .*not finite"),
            ({"C": [[1e200], [0.0], [1.0]]}, r"C of the plant .* 1e\+200.*nearer to 1"),
        ],
    )
    def test_matrices(self, form, parts, said):
        with pytest.raises(InputError, match=said):
            hinf(changed(form(PLANT), **parts), measurements=1, controls=1)

    @pytest.mark.parametrize(
        ("numbers", "said"),
        [
            ((None, None), "needs the numbers"),
            ((1, 9), "system with 3 inputs"),
            ((-1, 1), "system with 3 inputs"),
            ((0, 1), "no measurements"),
            ((1, 3), "no exogenous inputs"),
            ((3, 1), "no performance outputs"),
            ((1.0, 1), "measurements is 1.0; it must be a whole number"),
            (("1", 1), "measurements is '1'"),
            ((1, True), "controls is True"),
        ],
    )
    def test_numbers_of_signals(self, form, numbers, said):
        with pytest.raises(InputError, match=said):
            hinf(form(PLANT), measurements=numbers[0], controls=numbers[1])

    @pytest.mark.parametrize("gamma", ["a", 1j, 0.0, -1.0, np.nan, np.inf, True])
    def test_levels_that_are_none(self, form, gamma):
        with pytest.raises(InputError, match=r"gamma is .* positive and finite, or None"):
            hinf(form(PLANT), measurements=1, controls=1, gamma=gamma)

    @pytest.mark.parametrize("method", ["riccati", "sb10ad", "clarabel"])
    def test_levels_that_cannot_be_had(self, form, method):
        with pytest.raises(SolverError, match=r"0\.001"):
            hinf(form(PLANT), measurements=1, controls=1, gamma=1e-3, method=method)

    def test_levels_that_ask_nothing(self, form):
        within = hinf(form(PLANT), measurements=1, controls=1, gamma=1e6).norm
        for gamma in (1e12, 1e308):
            answer = hinf(form(PLANT), measurements=1, controls=1, gamma=gamma)
            assert answer.norm == pytest.approx(within, rel=1e-3)

    def test_methods_and_options(self, form):
        with pytest.raises(UnknownNameError, match="riccati"):
            hinf(form(PLANT), measurements=1, controls=1, method="dk")
        with pytest.raises(InputError, match=r"Options\(...\)"):
            hinf(form(PLANT), measurements=1, controls=1, options=3)

    def test_plants_of_other_kinds(self, form):
        system = form(PLANT)
        least = hinf(system, measurements=1, controls=1).gamma
        assert hinf(control.ss2tf(system), measurements=1, controls=1).gamma == pytest.approx(
            least, rel=1e-9
        )
        with pytest.raises(InputError, match="TransferFunction needs the numbers"):
            hinf(control.ss2tf(system))
        with pytest.raises(InputError, match="system must be a StateSpace, not TransferFunction"):
            GeneralisedPlant(control.ss2tf(system), None, 1, 1)
        for wrong in (np.eye(3), control.frd(system, [1.0])):
            with pytest.raises(InputError, match="belong to a StateSpace"):
                hinf(wrong, measurements=1, controls=1)
            with pytest.raises(InputError, match="must be a GeneralisedPlant"):
                hinf(wrong)
        with pytest.raises(InputError, match="must be a GeneralisedPlant, not StateSpace"):
            HinfSynthesis(system)

    def test_a_direct_term_from_control_to_measurement_is_shifted_away(self, form):
        without = hinf(form(PLANT), measurements=1, controls=1)
        for D22 in (-3.0, 0.7):
            answer = hinf(
                changed(form(PLANT), D=entry(PLANT.D, D22, 2, 2)), measurements=1, controls=1
            )
            assert answer.gamma == pytest.approx(without.gamma, rel=1e-9)

    def test_a_static_plant(self, form):
        D = [[0.5, 2.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.3]]
        static = control.ss([], [], [], D, form(PLANT).dt)
        assert hinf(static, measurements=1, controls=1).norm == pytest.approx(
            0.5 * np.sqrt(1.0 + 16.0), rel=2e-3
        )
        for method, said in (("sb10ad", "with states"), ("clarabel", "no states")):
            with pytest.raises(InputError, match=said):
                hinf(static, measurements=1, controls=1, method=method)

    def test_a_controller_of_another_size(self, form):
        plant = GeneralisedPlant(form(PLANT), None, 1, 1)
        with pytest.raises(
            InputError, match="controller has 2 inputs and 2 outputs; the plant has 1"
        ):
            plant.close(control.append(KD, KD))
        with pytest.raises(InputError, match=r"controller must be a StateSpace.*not str"):
            plant.close("K")


def assumptions_of(system):
    """The assumptions of H-infinity synthesis, tested without a perturbation."""
    return checked(standard_plant(GeneralisedPlant(system, None, 1, 1)))


def test_direct_terms_of_a_sampled_plant_are_those_at_half_the_sampling_rate():
    """D12 = 0 costs nothing continuous a control, but a sampled one acts on z one sample later."""
    assert (
        hinf(changed(sampled(PLANT), D=entry(PLANT.D, 0.0, 1, 2)), measurements=1, controls=1).norm
        < np.inf
    )
    with pytest.raises(SingularPlantError, match="D12"):
        assumptions_of(changed(PLANT, D=entry(PLANT.D, 0.0, 1, 2)))
    silent = {"C": [[0.0], [0.0], [1.0]], "D": entry(PLANT.D, 0.0, 1, 2)}
    with pytest.raises(SingularPlantError, match=r"D12.*responses at z = -1"):
        assumptions_of(changed(sampled(PLANT), **silent))


def test_zeros_on_the_stability_boundary_are_placed():
    parts = [[1.0, 0.0, 1.0]], [[0.0], [1.0]], [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    with pytest.raises(SingularPlantError, match=r"invariant zero.*at 0\+0j rad/s.*regularised"):
        assumptions_of(control.ss([[0.0]], *parts))
    with pytest.raises(SingularPlantError, match=r"invariant zero.*at z = 1\+0j.*regularised"):
        assumptions_of(control.StateSpace([[1.0]], *parts, 0.1, remove_useless_states=False))


def test_sampling_times_that_are_not_known():
    with pytest.raises(InputError, match="dt=True"):
        hinf(changed(PLANT, dt=True), measurements=1, controls=1)
    with pytest.raises(InputError, match="dt=True"):
        LoopShaping(control.tf([1.0], [1.0, -0.5], True))
    assert hinf(changed(PLANT, dt=None), measurements=1, controls=1).K.dt == 0.0


def test_zero_is_claimed_no_closer_than_it_is_known():
    """K cancels w -> z, and what is left are rounding errors."""
    system = control.ss([[-1.0]], [[1.0, 0.1]], [[1.0], [0.1]], [[0.5, 1.0], [1.0, 0.0]])
    for gamma in (None, 1e-6):
        assert 0.0 < hinf(system, measurements=1, controls=1, gamma=gamma).norm <= 1e-6


def test_poles_too_far_apart_are_perturbed_further():
    """The Riccati equations of slow weights, cheap control and little noise are ill-conditioned."""
    from workbench.plants.cd_drive.control.control_problem import generalised
    from workbench.plants.cd_drive.uncertainty.parametric_model import parametric_plant

    plant = (
        generalised("focus", parametric_plant("focus"))
        .channel(performance=["z_p", "z_u"], exogenous="w_p")
        .nominal()
    )
    wide = hinf(regularise(plant, 1e-1)).norm
    assert wide < 1.0
    assert hinf(regularise(plant, 1e-7)).norm < wide


# --- mixed sensitivity and loop shaping ---------------------------------------------------------


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({}, "no weight"),
        ({"W_S": S + 1, "W_KS": 1.0}, "W_S has no realisation.*short T"),
        ({"W_S": 1.0, "W_KS": 1 / S}, r"not detectable.*mode 0.*no measurement drives it"),
        ({"W_S": 1.0, "W_T": 1 / S, "W_KS": 1.0}, r"not detectable.*mode 0.*no measurement"),
        ({"W_S": 1 / (S - 1), "W_KS": 1.0}, "not detectable.*weights must be stable"),
        ({"W_S": np.nan, "W_KS": 1.0}, "W_S is nan"),
        ({"W_S": 1.0, "W_KS": np.inf}, "W_KS is inf"),
        ({"W_S": 1j, "W_KS": 1.0}, "W_S must be"),
        ({"W_S": True, "W_KS": 1.0}, "W_S must be"),
        ({"W_S": [1.0, 2.0], "W_KS": 1.0}, "W_S has 2 inputs"),
        ({"W_S": control.ss([], [], [], np.eye(3)), "W_KS": 1.0}, "W_S has 3 inputs"),
        ({"W_S": control.tf(1, [1, -0.5], 0.1), "W_KS": 1.0}, "sampling times"),
    ],
)
def test_weights_of_mixed_sensitivity(weights, said):
    with pytest.raises(InputError, match=said):
        MixedSensitivity(G, **weights)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"W1": np.inf}, "W1 is inf"),
        ({"W1": None}, "W1 must be"),
        ({"W1": S}, "W1 has no realisation"),
        ({"W1": control.ss([], [], [], np.eye(2))}, "W1 has 2 outputs; G has 1"),
        ({"W2": control.ss([], [], [], np.eye(2))}, "W2 has 2 inputs"),
        ({"W1": control.tf([1.0], [1.0, -0.5], 0.1)}, "sampling times"),
        ({"gamma": 0.0}, "gamma is"),
    ],
)
def test_weights_of_loop_shaping(arguments, said):
    with pytest.raises(InputError, match=said):
        LoopShaping(G, **arguments)


def test_a_plant_beyond_doubles_is_named():
    with pytest.raises(InputError, match=r"entry of size 1e\+300, whose square overflows"):
        solve(LoopShaping(control.ss([[-1e300]], [[1.0]], [[1.0]], [[0.0]])))


def test_an_unstable_pole_that_a_weight_cancels_is_named():
    with pytest.raises(InputError, match=r"unstable mode 1.*take it out"):
        LoopShaping(1 / (S - 1), W1=(S - 1) / (S + 1))


def test_infeasible_and_idle_levels_of_loop_shaping():
    below = solve(LoopShaping(G, gamma=0.9))
    assert below.claim is Outcome.INFEASIBLE
    assert "0.9" in below.message
    assert solve(LoopShaping(G, gamma=1e308)).certificate.holds


def test_a_margin_is_found_far_from_the_poles():
    """Where |G| is 1 the plant is 1 / s^2 in another unit of time: 1 / sqrt(4 + sqrt(8))."""
    solution = solve(LoopShaping(1e12 / (S**2 + 1e-6 * S + 1)))
    assert solution.certificate.holds, solution.certificate.failures
    assert solution.metrics["epsilon"] == pytest.approx((4 + 8**0.5) ** -0.5, rel=2e-3)


# --- regularised --------------------------------------------------------------------------------


@pytest.mark.parametrize("size", ["a", None, 0.0, -1.0, np.nan, np.inf, True])
def test_sizes_that_are_none(size):
    with pytest.raises(InputError, match="size is"):
        regularise(GeneralisedPlant(PLANT, None, 1, 1), size)


def test_what_cannot_be_made_regular():
    with pytest.raises(InputError, match="must be a GeneralisedPlant, not StateSpace"):
        regularise(PLANT, 1e-3)
    half = changed(PLANT, A=[[-1.0]], dt=0.1)
    with pytest.raises(InputError, match="z = -1"):
        regularise(GeneralisedPlant(half, None, 1, 1), 1e-3)


# --- mu synthesis -------------------------------------------------------------------------------


def without(**parts):
    """The benchmark plant with some of its matrices replaced."""
    return replace(UNCERTAIN, system=changed(UNCERTAIN.system, **parts))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"plant": None}, "GeneralisedPlant, not NoneType"),
        ({"structure": [[1, 1]]}, "structure must be a Structure, not list.*from_pairs"),
        ({"structure": Structure([Full(5, 5)])}, "structure needs 5 and 5"),
        ({"structure": Structure([Complex(2)])}, "0 exogenous inputs"),
        ({"start": control.append(K, K)}, "controller has 2 inputs and 2 outputs"),
        ({"start": control.ss([], [], [], [[0.0]])}, r"does not stabilise.*real part 1 at 1"),
        ({"start": control.ss([], [], [], [[-1e300]])}, "does not stabilise"),
        ({"start": KD}, "start has dt = 0.1 s, the plant 0.0 s"),
        ({"family": "PID"}, "family must be a Family, not str"),
        ({"target": "a"}, "target is 'a'"),
        ({"plant": without(A=np.full((3, 3), np.nan))}, "A of the plant .* not finite"),
        ({"plant": without(A=0.5 * np.eye(3), dt=True)}, "sampling time is not given"),
    ],
)
def test_what_mu_synthesis_refuses(arguments, said):
    with pytest.raises(InputError, match=said):
        MuSynthesis(**{"plant": UNCERTAIN, **arguments})


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", ["dk", pytest.param("mu-dk", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("name", "place"), [("D21", (-1, slice(0, -1))), ("D12", (slice(0, -1), -1))]
)
def test_a_plant_without_an_h_infinity_step_is_perturbed(method, name, place):
    plant = without(D=entry(UNCERTAIN.system.D, 0.0, *place))
    with pytest.raises(SingularPlantError, match=name):
        checked(standard_plant(plant))
    own = solve(MuSynthesis(plant), method=method)
    regular = solve(MuSynthesis(regularise(plant, 1e-2)), method=method)
    assert own.certificate.holds and regular.certificate.holds
    assert own.answer.upper <= 1.05 * regular.answer.upper


def test_a_start_is_kept_or_improved_where_steps_must_be_perturbed():
    program = MuSynthesis(without(D=entry(UNCERTAIN.system.D, 0.0, -1, slice(0, -1))), start=K)
    solution = solve(program, method="dk")
    assert solution.certificate.holds
    assert solution.answer.upper <= 1.01 * program.certified_peak(K).upper


def test_methods_of_mu_synthesis_that_cannot_be_used():
    with pytest.raises(UnknownNameError, match="mu-dk"):
        solve(MuSynthesis(UNCERTAIN), method="hinf")
    assert "give start" in solve(MuSynthesis(UNCERTAIN), method="fixed").message


@pytest.mark.slow
def test_a_direct_term_and_a_transfer_function_are_nothing_to_mu_synthesis():
    plain = solve(MuSynthesis(UNCERTAIN)).answer.upper
    direct = without(D=entry(UNCERTAIN.system.D, 0.3, -1, -1))
    assert solve(MuSynthesis(direct)).answer.upper == pytest.approx(plain, rel=5e-3)
    start = MuSynthesis(UNCERTAIN, start=control.ss2tf(K))
    assert start.certified_peak(start.start).upper == pytest.approx(
        start.certified_peak(K).upper, rel=1e-3
    )


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", ["dk", "mu-dk"])
def test_mu_synthesis_of_a_static_plant(method):
    static = control.ss([], [], [], np.eye(3)[::-1] + 0.1)
    solution = solve(
        MuSynthesis(GeneralisedPlant(static, Structure([Full(1, 1)]), 1, 1)), method=method
    )
    assert solution.certificate.holds


def test_a_performance_that_is_zero():
    system = UNCERTAIN.system
    silent = without(C=entry(system.C, 0.0, 1), D=entry(system.D, 0.0, 1))
    solution = solve(MuSynthesis(silent), method="dk")
    assert solution.certificate.holds or "D12" in solution.message


# --- reduction, sampling, files -----------------------------------------------------------------


@pytest.mark.parametrize("order", [1.0, 1.5, "1", None, True, -1, 99])
def test_orders_that_are_none(order):
    with pytest.raises(InputError, match="order is"):
        approximate(K, order, method="balanced")


@each(
    ("call", "said"),
    [
        (lambda: approximate(K, 1, method="schur"), "method is 'schur'"),
        (lambda: approximate(K, 1), "give the plant"),
        (lambda: approximate(K, 1, plant=UNCERTAIN.system), "must be a GeneralisedPlant"),
        (lambda: approximate(control.append(K, K), 1, plant=UNCERTAIN), "controller has 2 inputs"),
        (lambda: approximate(KD, 1, plant=UNCERTAIN), "controller is sampled"),
        (lambda: reduce_order(None, K), "must be a GeneralisedPlant"),
        (lambda: reduce_order(UNCERTAIN, K, target="a"), "target is 'a'"),
        (lambda: reduce_order(UNCERTAIN, K, target=np.nan), "target is nan"),
        (lambda: reduce_order(UNCERTAIN, K, order="a"), "order is 'a'"),
        (lambda: reduce_order(UNCERTAIN, control.ss([], [], [], [[0.0]])), "unstable.*stabilises"),
        (lambda: discretise(K, "a"), r"dt is 'a'"),
        (lambda: discretise(K, None), r"dt is None"),
        (lambda: discretise(K, 0.0), r"dt is 0.0"),
        (lambda: discretise(K, 0.1, method="euler"), "method is 'euler'"),
        (lambda: discretise(K, 0.1, prewarp="a"), "prewarp is 'a'"),
        (lambda: discretise(K, 0.1, prewarp=np.nan), "prewarp is nan"),
        (lambda: discretise(KD, 0.1), "sampled already"),
        (lambda: discretise(K, 0.01, plant=control.append(G, G)), "the plant has 2 outputs"),
        (lambda: discretise(K, 0.01, plant=KD), "the plant is sampled"),
        (lambda: sampled_conditions(G, KD, "a"), r"dt is 'a'"),
        (lambda: sampled_conditions(G, KD, 0.2), r"controller has dt = 0.1.*every 0.2 s"),
        (lambda: sampled_conditions(G, G, 0.1), r"controller has dt = 0.*discretised\(\)"),
        (lambda: sampled_conditions(KD, KD, 0.1), "the plant is sampled"),
        (lambda: sampled_conditions(control.append(G, G), KD, 0.1), "the plant has 2 outputs"),
        (lambda: sampled_conditions(G, KD, 0.1, sign="-"), "sign is '-'"),
        (lambda: sampled_conditions(G, KD, 0.1, delay_samples="a"), "delay_samples is 'a'"),
        (lambda: sampled_conditions(G, KD, 0.1, delay_samples=-0.5), "delay_samples is -0.5"),
        (lambda: sampled_conditions(G, KD, 0.1, delay_samples=np.inf), "delay_samples is inf"),
        (
            lambda: sampled_conditions(G, KD, 0.1, delay_samples=1e9),
            "delay_samples is 1000000000.0.*to 1000",
        ),
        (lambda: second_order_sections(K), "discretise it first"),
        (lambda: export(K, "never.h", "c"), r"discretised\(\)"),
        (lambda: export(K, "never.xml", "xml"), "format is 'xml'"),
        (lambda: export(K, "no/such/folder.json", "json"), "cannot be written"),
        (lambda: export(K, "never.json", "json", metadata=[1]), "metadata"),
    ],
)
def test_what_is_refused(call, said):
    with pytest.raises(InputError, match=said):
        call()


def test_a_gain_without_a_sampling_time_has_any():
    gain = control.ss([], [], [], [[1.0]])
    assert gain.dt is None
    assert sampled_conditions(G, gain, 0.1).stable


def test_a_target_that_no_order_reaches():
    assert reduce_order(UNCERTAIN, K, target=1e-3).smallest is None


@pytest.mark.parametrize(
    "content", [b"", b"\x00\x01", b"{}", b'{"kind": "workbench controller"}', b"[1]", b"{a"]
)
def test_files_that_hold_no_controller(tmp_path, content):
    (tmp_path / "file").write_bytes(content)
    for path in (tmp_path / "file", tmp_path / "missing", tmp_path):
        with pytest.raises(ResultError, match="holds no controller"):
            load_controller(path)
