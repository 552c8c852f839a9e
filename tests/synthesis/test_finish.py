"""An iteration ends on time, with an answer, and with few states."""

from dataclasses import replace

import control
import numpy as np
import pytest
from workbench.plants.textbook.distillation import distillation_column
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench._core.arrays import EPS
from workbench.certify.stability import stability_check
from workbench.errors import InputError, TimeLimitError
from workbench.executor import Context
from workbench.executor.clock import proving
from workbench.mu import upper_bound
from workbench.solvers import Options, Outcome
from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis import MuSynthesis, hinf
from workbench.synthesis.mu import finish, scaling_fit
from workbench.synthesis.mu.finish import with_few_states
from workbench.synthesis.mu.scaled_plant import scaled_plant
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.synthesis.reduction.truncation import balanced_truncation
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import matrices_of, realisation
from workbench.uncertainty import GeneralisedPlant, generalised_plant, real, tf


def mass_damper_spring():
    """D.-W. Gu, P. Petkov, M. Konstantinov, Robust Control Design with MATLAB (2005), chapter 8."""
    m, c, k = real("m", 3, percent=40), real("c", 1, percent=20), real("k", 2, percent=30)
    W_p, W_u = control.tf([0.95, 1.71, 9.5], [1, 8, 0.01]), control.tf([0.01], [1.0])
    parts = [(tf([1], [m, c, k]), "u", "x"), (W_p, "e", "z_e"), (W_u, "u", "z_u")]
    return generalised_plant(
        parts,
        {"e": "r - x"},
        exogenous=["r"],
        performance=["z_e", "z_u"],
        control=["u"],
        measurement="e",
    )


def five_dynamic_blocks(seed=0, states=30):
    """A random stable plant with ten perturbation channels in blocks of two."""
    rng = np.random.default_rng(seed)
    A = -np.diag(10 ** rng.uniform(-1, 2, states))
    for i in range(0, states - 1, 3):
        A[i, i + 1], A[i + 1, i] = 2 * abs(A[i, i]), -2 * abs(A[i, i])
    root = np.sqrt(np.abs(np.diag(A)))
    B = rng.standard_normal((states, 14)) * root[:, None]
    C = rng.standard_normal((14, states)) * root / np.sqrt(states) * 0.6
    C[:10] *= 0.3
    D = np.zeros((14, 14))
    D[10:12, -2:] = D[-2:, 10:12] = 0.3 * np.eye(2)
    return GeneralisedPlant(control.ss(A, B, C, D), Structure([Full(2, 2)] * 5), 2, 2)


@pytest.mark.cases(0)
def test_the_textbook_case_has_a_controller_of_few_states():
    solution = wb.solve(MuSynthesis(mass_damper_spring()))
    assert solution.holds and solution.answer.upper < 0.97  # 0.965 at order 20 in the book
    assert solution.answer.K.nstates <= 25


@pytest.mark.cases(0)
@pytest.mark.parametrize("seed", range(3))
def test_states_that_do_nothing_are_left_out_and_the_peak_stays(seed):
    rng = np.random.default_rng(seed)
    program = MuSynthesis(unstable_first_order())
    K = wb.solve(program, method="dk").answer.K
    more = control.rss(6, 1, 1)
    size = 1e-9 * 10 ** rng.uniform(-2, 0)
    larger = K + size * control.ss(more.A - 5 * np.eye(6), more.B, more.C, more.D)
    most = 1.001 * program.certified_peak(K).upper
    few = with_few_states(program, larger, most)
    assert few.nstates <= K.nstates
    assert program.certified_peak(few).lower <= most


@pytest.mark.cases(0)
def test_no_state_is_left_out_that_the_peak_needs():
    program = MuSynthesis(unstable_first_order())
    K = wb.solve(program, method="dk").answer.K
    assert with_few_states(program, K, 0.0) is K


def test_the_controller_of_a_plant_without_states_loses_those_that_it_does_not_need():
    plant = generalised_plant(
        [(control.tf([0.5], [1.0]), "v", "y"), (control.tf([0.2], [1.0]), "u", "z")],
        {"v": "u + d", "e": "r - y"},
        perturbation=[(Complex(1), "z", "d")],
        exogenous=["r"],
        performance=["e"],
        control=["u"],
        measurement="e",
    )
    program = MuSynthesis(plant)
    gain = control.ss([], [], [], [[1.0]])
    most = 1.001 * program.certified_peak(gain).upper
    lag = control.ss(-1.0, 1e-6, 1.0, 0.0)
    assert with_few_states(program, gain + lag, most).nstates == 0
    assert with_few_states(program, gain + lag, 0.1 * most).nstates == 1


@pytest.mark.cases(0)
def test_the_loop_with_the_scalings_of_the_design_tells_which_states_matter():
    program = MuSynthesis(unstable_first_order())
    answer = wb.solve(replace(program, target=0.69), method="dk").answer
    most = 1.001 * answer.upper
    alone = balanced_truncation(kept_and_stable(matrices_of(answer.K)))[1]
    fewest = next(
        order
        for order in range(answer.K.nstates + 1)
        if peak_on_grid(program, realisation(alone(order), 0.0)) <= most
    )
    scaled = scaled_plant(program.plant, answer.history[-1].scalings)
    assert with_few_states(program, answer.K, most, scaled).nstates < fewest


def peak_on_grid(program, K):
    """Largest bound on mu at frequencies of the loop; infinite if it is not stable."""
    loop = program.plant.close(K)
    if not stability_check(loop).holds:
        return np.inf
    return upper_bound(response(loop, frequencies_of(loop)), program.closed_structure).value.max()


@pytest.mark.cases(0)
def test_one_truncation_is_enough(monkeypatch):
    program = MuSynthesis(unstable_first_order())
    K = wb.solve(program, method="dk").answer.K
    larger = control.append(K, control.ss(-3.0, 1.0, 1.0, 0.0))[0, 0]

    def no_gramians(*_):
        raise InputError("the Gramians do not exist")

    for name in ("balanced_truncation", "loop_weighted_truncation"):
        with monkeypatch.context() as patch:
            patch.setattr(finish, name, no_gramians)
            few = with_few_states(program, larger, 1.01 * program.certified_peak(K).upper)
        assert few.nstates <= K.nstates
    monkeypatch.setattr(finish, "_truncations", lambda *_: [])
    assert with_few_states(program, K, np.inf) is K


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(11))
def test_last_bits_of_the_plant_do_not_decide_the_order(seed):
    """Its weights have poles at -1e-6 rad/s, which last bits turn into integrators."""
    rng = np.random.default_rng([6, seed])
    plant = distillation_column()
    matrices = [
        part * (1 + EPS * rng.choice([-1, 0, 1], part.shape)) for part in matrices_of(plant.system)
    ]
    program = MuSynthesis(replace(plant, system=realisation(matrices, 0.0)))
    answer = wb.solve(program, method="dk").answer
    assert answer.K.nstates <= 24  # 38 before the reduction
    assert answer.upper <= 0.937


def late_in(context, monkeypatch, after):
    """Let the limit pass at a step of the fit of scalings."""
    told, plain = [], scaling_fit.ScalingFit._cost

    def cost(*arguments):
        told.append(1)
        if len(told) == after:
            context.started -= 1000.0
        return plain(*arguments)

    monkeypatch.setattr(scaling_fit.ScalingFit, "_cost", cost)


@pytest.mark.cases(0)
@pytest.mark.parametrize("after", [1, 40])
def test_the_limit_ends_a_fit_in_its_midst_and_the_first_controller_is_there(monkeypatch, after):
    context = Context(options=Options(time_limit=1000.0))
    late_in(context, monkeypatch, after)
    solution = wb.solve(MuSynthesis(unstable_first_order()), method="dk", context=context)
    assert solution.outcome is Outcome.TIME_LIMIT and solution.certificate.holds
    assert solution.message.startswith("time limit of 1000 s reached")
    whole = wb.solve(MuSynthesis(unstable_first_order()), method="dk")
    assert solution.answer.upper >= whole.answer.lower


def test_without_time_for_another_certificate_the_last_one_counts(monkeypatch):
    program = MuSynthesis(unstable_first_order(), start=hinf(unstable_first_order()).K)
    first = program.answer(program.start)

    def never(*_):
        raise TimeLimitError("order of the controller: time limit of 1000 s reached")

    context = Context(options=Options(time_limit=1000.0), watch=lambda _: None)

    def watch(rows):
        if len(rows) == 2:
            monkeypatch.setattr(finish, "with_few_states", never)
            context.started -= 1000.0

    context.watch = watch
    monkeypatch.setattr(finish, "MUCH_BETTER", 1.0)  # only the first one is certified
    solution = wb.solve(program, method="dk", context=context)
    assert solution.outcome is Outcome.TIME_LIMIT and solution.certificate.holds
    assert solution.answer.upper == pytest.approx(first.upper, rel=1e-2)
    assert len(solution.answer.history) == 2


def test_the_proof_of_a_peak_heeds_the_time_set_for_it():
    program = MuSynthesis(unstable_first_order())
    K = hinf(unstable_first_order()).K
    with proving(0.0), pytest.raises(TimeLimitError, match="proof of a peak"):
        program.certified_peak(K)


def lag_with(block, gain, *, coupled):
    """A lag, and beside it a block that nothing of the loop moves."""
    G, W = control.tf([1.0], [1.0, 1.0]), control.tf([0.4], [1.0, 0.01])
    parts = [(G, "v", "y"), (W, "e", "z_e"), (control.tf([0.1], [1.0]), "u", "z_u")]
    parts += [(control.tf([gain], [1.0, 1.0]), "w2", "z2"), (control.tf([0.2], [1.0]), "u", "z1")]
    blocks = [(Complex(1), "z1", "d")] if coupled else []
    return generalised_plant(
        parts,
        {"v": "u + d" if coupled else "u", "e": "r - y"},
        perturbation=[*blocks, (block, "z2", "w2")],
        exogenous=["r"],
        performance=["z_e", "z_u"],
        control=["u"],
        measurement="e",
    )


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("method", "coupled", "gain", "block"),
    [
        ("dk", False, 0.5, Complex(1)),
        ("dk", False, 0.0, Complex(1)),
        ("dk", True, 0.0, Real(1)),
        ("mu-dk", False, 0.5, Real(1)),
        ("dgk", False, 0.5, Real(1)),
        ("dgk", True, 0.0, Complex(1)),
    ],
)
def test_a_decoupled_block_is_no_hindrance(method, coupled, gain, block):
    with_block = wb.solve(MuSynthesis(lag_with(block, gain, coupled=coupled)), method=method)
    assert with_block.certificate.holds, with_block
    assert with_block.answer.lower >= 0.99 * gain * isinstance(block, Complex)
    assert with_block.answer.upper <= 0.51


def test_a_performance_on_which_nothing_acts_has_the_peak_zero():
    G = control.tf([1.0], [1.0, 1.0])
    parts = [(G, "u", "y"), (control.tf([0.0], [1.0]), "e", "z_e")]
    parts += [(control.tf([0.2], [1.0]), "u", "z1")]
    plant = generalised_plant(
        parts,
        {"e": "r - y", "m": "e + d"},
        perturbation=[(Complex(1), "z1", "d")],
        exogenous=["r"],
        performance=["z_e"],
        control=["u"],
        measurement="m",
    )
    for method in ("dk", "mu-dk", "dgk"):
        solution = wb.solve(MuSynthesis(plant), method=method)
        assert solution.certificate.holds, solution
        assert solution.answer.upper < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_five_dynamic_blocks_are_done_in_a_minute_nearly_as_well_as_without_a_limit(seed):
    program = MuSynthesis(five_dynamic_blocks(seed))
    context = Context(options=Options(time_limit=60.0))
    short = wb.solve(program, method="dk", context=context)
    took = short.seconds["solve"] + short.seconds["check"]
    whole = wb.solve(program, method="dk")
    assert short.certificate.holds
    assert took < 62.0
    assert short.answer.upper <= 1.02 * whole.answer.upper
