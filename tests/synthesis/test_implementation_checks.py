"""What an implemented controller claims is found again, read back from its code, and tried."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest

import workbench as wb
from workbench.second_opinion.implemented.c_header import state_space_of
from workbench.synthesis import Implementation
from workbench.synthesis.implementation import program as implementation
from workbench.uncertainty import UncertaintyModel

LAG, LEAD = control.tf([1.0], [1.0, 1.0]), control.tf([2.0, 3.0], [0.05, 1.0])
PI = control.tf([2.0, 3.0], [1.0, 0.0])
TWO = control.append(LAG, control.tf([2.0], [1.0, 3.0]))
FIXED = {"precision": "fixed", "full_scale": (1.0, 100.0)}
CASES = {
    "double": (LEAD, LAG, {}),
    "float with limits": (PI, LAG, {"precision": "float", "limits": (-1.0, 1.0)}),
    "fixed": (LEAD, LAG, FIXED),
    "few bits": (PI, LAG, {**FIXED, "bits": 16, "signal_bits": 24}),
    "two channels": (control.append(LEAD, PI), TWO, {"precision": "float"}),
    "given sampled": (LEAD.sample(0.02, "tustin"), LAG, {}),
    "integrating plant": (LEAD, control.tf([1.0], [1.0, 0.0]), {}),
}


@pytest.fixture(scope="module")
def boards():
    """Program and answer of each case, made once."""
    return {}


@pytest.fixture
def board(boards, case):
    if case not in boards:
        K, G, options = CASES[case]
        program = Implementation(G, K, dt=0.02, **options)
        solution = wb.solve(program, method="tustin")
        assert solution.holds, solution.certificate or solution.message
        boards[case] = program, solution.answer
    return boards[case]


def changed(answer):
    """The answer with one thing told wrong, by name."""
    first = answer.margins[0]
    told = {
        "phase": {"phase_deg": first.phase_deg + 20.0},
        "gain": {"gain": (first.gain[0], first.gain[1] * 1.5 if first.gain[1] < 1e9 else 2.0)},
        "delay": {"delay_samples": first.delay_samples * 0.8},
    }
    for name, fields in told.items():
        yield name, replace(answer, margins=(replace(first, **fields), *answer.margins[1:]))
    yield "no margins", replace(answer, margins=())
    for factor in (0.0, 0.8, 1.25, -1.0):
        yield f"K times {factor}", replace(answer, K=factor * answer.K)
    yield "sensitivity", replace(answer, sensitivity=0.8 * answer.sensitivity)
    share = 0.5 * answer.rounding.share
    yield "rounding", replace(answer, rounding=replace(answer.rounding, share=share))
    yield "another way", replace(answer, found="by a friend")
    if answer.fixed is not None:
        for factor in (-1, 1024):
            cascades = tuple(
                tuple(replace(one, numerators=factor * one.numerators) for one in line)
                for line in answer.fixed.cascades
            )
            fixed = replace(answer.fixed, cascades=cascades)
            yield f"integers times {factor}", replace(answer, fixed=fixed)


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
def test_what_is_told_wrong_fails(board, case):
    program, answer = board
    for name, wrong in changed(answer):
        if name == "another way" and case == "given sampled":
            continue  # there is one way only
        with np.errstate(all="ignore"):
            assert not program.certify(wrong, 1e-6).valid, name


@pytest.fixture
def found_once(monkeypatch):
    """Margins, which take seconds, are found for the first controller only."""
    honest, kept = implementation.sampled_conditions, []

    def once(*given, **named):
        kept.extend([] if kept else [honest(*given, **named)])
        return kept[0]

    monkeypatch.setattr(implementation, "sampled_conditions", once)


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", ["double", "few bits"])
def test_each_claim_is_refused_by_the_check_of_its_name(board, case, found_once):
    """By the kernel alone, whatever the second opinion says."""
    program, answer = board
    first, share = answer.margins[0], answer.rounding.share
    wrong = {
        "sensitivity": {"sensitivity": 0.99 * answer.sensitivity},
        "margins": {
            "margins": (replace(first, phase_deg=0.99 * first.phase_deg), *answer.margins[1:])
        },
        "rounding": {"rounding": replace(answer.rounding, share=0.99 * share)},
        "controller": {"found": "by a friend"},
    }
    for name, fields in wrong.items():
        failed = {c.name for c in program.checks(replace(answer, **fields), 1e-6) if not c.holds}
        assert failed == {name}
    if answer.fixed is not None:
        cascades = tuple(
            tuple(replace(one, largest=one.largest + 0.5) for one in line)
            for line in answer.fixed.cascades
        )
        louder = replace(answer, fixed=replace(answer.fixed, cascades=cascades))
        assert "no overflow" in {c.name for c in program.checks(louder, 1e-6) if not c.holds}


def test_every_coefficient_is_a_number_of_the_format(found_once):
    K, G, options = CASES["float with limits"]
    program = Implementation(G, K, dt=0.02, **options)
    answer = program.implemented("tustin")
    assert all(check.holds for check in program.checks(answer, 1e-6))
    for name in "ABCD":
        parts = {part: getattr(answer.K, part) for part in "ABCD"}
        parts[name] = parts[name] * (1 + 1e-9)
        other = control.ss(*parts.values(), answer.K.dt)
        found = program.checks(replace(answer, K=other), 1e-6)
        assert not next(c for c in found if c.name == "coefficients").holds, name


def test_a_bound_of_mu_that_is_claimed_too_small(found_once):
    model = UncertaintyModel(LAG, control.tf([0.1], [1.0]), control.tf([0.2, 0.2], [0.1, 1.0]))
    program = Implementation(model, LEAD, dt=0.02)
    answer = program.implemented("tustin")
    checks = {check.name: check for check in program.checks(answer, 1e-6)}
    assert all(check.holds for check in checks.values())
    smaller = replace(answer.peak, upper=0.99 * answer.peak.upper)
    found = program.checks(replace(answer, peak=smaller), 1e-6)
    assert {check.name for check in found if not check.holds} == {"sets of plants"}


@pytest.mark.cases(2)
@pytest.mark.parametrize("case", [name for name in CASES if not name.startswith(("fixed", "few"))])
def test_the_code_is_read_back(board, case):
    _, answer = board
    K = answer.K
    kind = np.float32 if answer.precision == "float" else np.float64
    read = state_space_of(answer.code()).astype(kind)
    assert np.array_equal(read, np.block([[K.A, K.B], [K.C, K.D]]).astype(kind))


@pytest.mark.parametrize("case", CASES)
def test_code_of_another_controller_is_found(board, case, monkeypatch):
    program, answer = board
    text = answer.code()
    start = text.index("{", text.index("_step("))
    number = re.compile(r"-?\d[\d.e+-]*(?=f? \* )").search(text, start)
    more = str(3 * int(number[0])) if answer.fixed else repr(3.0 * float(number[0]))
    other = text[: number.start()] + more + text[number.end() :]
    monkeypatch.setattr(type(answer), "code", lambda self, name="controller": other)
    failed = {check.name for check in program.second_opinion(answer) if not check.holds}
    assert failed == {"code"}
