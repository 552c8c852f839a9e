"""Fault estimation: agreement of methods, members of the set, requirements, refused input."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.certify.norms import certified_norm
from workbench.diagnosis import FaultEstimation, Requirement
from workbench.errors import InputError, UnknownNameError
from workbench.structure import Complex, Real
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant, response

LAG = control.tf([1.0], [1.0, 0.5])
SLOW, FAST = control.tf([1.0], [1.0, 0.01]), control.tf([1.0, 0.1], [1.0, 2.0])


def plant(block=None, exogenous=("d", "n", "f")):
    """y = (1 + 0.3 delta) d / (s + 0.5) + f + n."""
    read = " + ".join(["x", *(name for name in ("f", "n") if name in exogenous)])
    parts = [(LAG, "v", "x")]
    if block is None:
        return generalised_plant(
            parts, {"v": "d", "y": read}, exogenous=list(exogenous), measurement="y"
        )
    return generalised_plant(
        [*parts, (control.tf([0.3], [1.0]), "d0", "y_d")],
        {"v": "d + u_d", "d0": "d", "y": read},
        perturbation=[(block, "y_d", "u_d")],
        exogenous=list(exogenous),
        measurement="y",
    )


def requirements(**options):
    noise = control.ss([], [], [], [[0.05]])
    return [
        Requirement("disturbances", ["d", "n"], weight=control.append(control.ss(SLOW), noise)),
        Requirement("faults", "f", weight=FAST, **options),
    ]


def program(block=None, **options):
    return FaultEstimation(plant(block), "f", requirements=requirements(), **options)


@pytest.mark.slow
def test_riccati_and_every_lmi_agree_on_the_least_stacked_norm():
    least = {}
    for method in ("riccati", "clarabel", "cvxopt", "scs"):
        solution = wb.solve(program(), method=method)
        assert solution.certificate.valid, solution.certificate
        answer = solution.answer
        least[method] = answer.least
        assert answer.least * (1 - 1e-3) <= answer.stacked[1] <= 1.02 * answer.least
        closed = program().plant.close(answer.K)
        assert certified_norm(closed) == pytest.approx(answer.stacked[1], rel=2e-3)
    assert least["scs"] == pytest.approx(least["riccati"], rel=1e-2)  # of first order
    for method in ("clarabel", "cvxopt"):
        assert least[method] == pytest.approx(least["riccati"], rel=1e-3)


@pytest.mark.parametrize(
    ("block", "method"),
    [
        pytest.param(Complex(1), "dk", marks=pytest.mark.slow),
        pytest.param(Real(1), "basis", marks=pytest.mark.slow),
        pytest.param(Real(1), "dk", marks=pytest.mark.slow),
        pytest.param(Complex(1), "basis", marks=pytest.mark.slow),
    ],
)
def test_a_robust_filter_is_better_than_the_nominal_one_on_members_of_the_set(block, method):
    robust = program(block)
    nominal = wb.solve(robust, method="riccati").answer
    solution = wb.solve(robust, method=method)
    assert solution.certificate.valid, solution.certificate
    answer = solution.answer
    assert answer.upper < nominal.upper
    assert answer.lower <= answer.upper <= 1.002 * answer.lower
    omega = np.geomspace(1e-4, 1e3, 400)
    shapes = np.abs(np.stack([SLOW(1j * omega), 0.05 + 0 * omega, FAST(1j * omega)]))
    K = response(answer.K, omega)[:, 0, 0]
    rng = np.random.default_rng(0)
    for _ in range(20):
        delta = rng.uniform(-1, 1)
        if isinstance(block, Complex):
            delta = delta * np.exp(2j * np.pi * rng.uniform())
        through = (1 + 0.3 * delta) * LAG(1j * omega)
        disturbances = np.hypot(abs(K * through) * shapes[0], abs(K) * shapes[1])
        faults = abs(1 - K) * shapes[2]
        assert disturbances.max() <= answer.peaks[0, 1] * (1 + 1e-6)
        assert faults.max() <= answer.peaks[1, 1] * (1 + 1e-6)


@pytest.mark.slow
def test_the_basis_balances_its_requirements_and_keeps_its_poles():
    start = wb.solve(program(), method="riccati").answer
    answer = wb.solve(program(start=start.K), method="basis").answer
    assert answer.upper < 0.97 * start.upper
    assert answer.peaks[0, 1] == pytest.approx(answer.peaks[1, 1], rel=5e-3)
    np.testing.assert_allclose(np.sort(answer.K.poles()), np.sort(start.K.poles()), rtol=1e-6)
    assert list(answer.history) == sorted(answer.history, reverse=True)


@pytest.mark.slow
def test_a_requirement_of_a_band_says_nothing_of_other_frequencies():
    low = FaultEstimation(plant(), "f", requirements=requirements(band=(5.0, np.inf)))
    answer = wb.solve(low, method="basis").answer
    omega = np.geomspace(1e-3, 1e3, 2000)
    error = abs(1 - response(answer.K, omega)[:, 0, 0]) * abs(FAST(1j * omega))
    assert error[omega >= 5.0].max() <= answer.peaks[1, 1] * (1 + 1e-9)
    assert error.max() > 1.2 * answer.peaks[1, 1]


@pytest.mark.cases(0)
def test_an_answer_survives_its_dataset():
    one = program(Complex(1))
    answer = wb.solve(one, method="riccati").answer
    again = one.from_dataset(one.to_dataset(answer))
    np.testing.assert_array_equal(again.peaks, answer.peaks)
    assert all(check.holds for check in one.checks(again, 1e-6))
    assert set(one.figures(again)) == {"channels", "filter"}


@pytest.mark.cases(0)
def test_a_claim_too_good_is_found_out():
    one = program(Complex(1))
    answer = wb.solve(one, method="riccati").answer
    from dataclasses import replace

    failed = [c.name for c in one.checks(replace(answer, peaks=0.9 * answer.peaks), 1e-6)
              if not c.holds]  # fmt: skip
    assert failed == ["disturbances: peak", "faults: peak"]


def test_a_filter_of_no_use_is_said_to_be_one():
    blind = FaultEstimation(
        plant(), "f",
        requirements=[
            Requirement("n", ["n", "d"], weight=100.0),
            Requirement("f", "f", weight=control.tf([1.0], [1.0, 1.0])),
        ],
    )  # fmt: skip
    assert "cannot be told from disturbances" in wb.solve(blind, method="riccati").message


def test_what_the_measurement_does_not_show_is_named():
    bare = plant(exogenous=("d", "n", "f"))
    hidden = control.ss(bare.system)
    hidden = control.StateSpace(
        hidden.A, hidden.B * [1, 1, 0], hidden.C, hidden.D * [1, 1, 0],
        inputs=["d", "n", "f"], outputs=["y"],
    )  # fmt: skip
    with pytest.raises(InputError, match="no measurement shows the fault 'f'"):
        FaultEstimation(GeneralisedPlant(hidden, None, 0, 1), "f")


@pytest.mark.parametrize(
    "make, match",
    [
        (lambda: FaultEstimation(plant(), ["f", "n"]), "cannot be told from each other"),
        (lambda: FaultEstimation(plant(), "g"), "no exogenous input is called 'g'"),
        (
            lambda: FaultEstimation(plant(), "f", requirements=[Requirement("d", "d")]),
            "no requirement is about the faults",
        ),
        (lambda: Requirement("f", "f", bound=0.0), "the bound of 'f' is 0.0"),
        (lambda: Requirement("f", "f", band=(2.0, 1.0)), "the lower one first"),
        (
            lambda: FaultEstimation(
                plant(), "f", requirements=[Requirement("f", "f", weight=control.tf(1, [1, -1]))]
            ),
            "the weight of 'f' is not stable",
        ),
        (lambda: FaultEstimation(control.ss(LAG), "f"), "plant must be a GeneralisedPlant"),
        (
            lambda: FaultEstimation(
                generalised_plant([(LAG, "u", "y")], {}, control="u", measurement="y"), 0
            ),
            "the plant has 1 controls",
        ),
        (
            lambda: FaultEstimation(
                generalised_plant(
                    [(control.tf([1], [1, -1]), "f", "y")], {}, exogenous="f", measurement="y"
                ),
                "f",
            ),
            "close its controller first",
        ),
        (
            lambda: program(start=control.tf([1.0], [1.0, -1.0])),
            "the start must be stable, with 1 outputs and 1 inputs",
        ),
    ],
)
def test_wrong_input_is_named(make, match):
    with pytest.raises((InputError, UnknownNameError), match=match):
        make()


def test_mu_iterations_need_uncertainty():
    with pytest.raises(InputError, match="no uncertainty; take riccati"):
        wb.solve(program(), method="dgk")
