"""Proofs that equations have a zero near a start."""

import pytest
from flint import arb, ctx

from workbench.certify.krawczyk import zero_within

ROOT = arb(2).sqrt()


@pytest.mark.parametrize("bits", [128, 256, 512])
@pytest.mark.parametrize(("off", "near"), [(0.0, True), (0.7, True), (1.5, False)])
def test_a_start_within_a_thousandth_of_a_zero_proves_it(bits, off, near):
    with ctx.workprec(bits):
        start = [arb(float(ROOT)) * (1 + arb(off) * 2**-10)]
        box = zero_within(start, lambda y: [y[0] ** 2 - 2], lambda y: [[2 * y[0]]])
        assert (box is not None) == near
        if near:
            assert box[0].contains(arb(2).sqrt())
            assert float(box[0].rad()) < 2.0 ** (-bits / 2)


@pytest.mark.parametrize(("apart", "proven"), [(1e-2, True), (1e-14, True), (1e-17, False)])
def test_equations_are_dependent_only_up_to_the_rounding_of_doubles(apart, proven):
    with ctx.workprec(128):
        rows = [[arb(1), arb(1)], [arb(1), arb(1) + arb(apart)]]
        found = zero_within(
            [arb(1), arb(1)],
            lambda y: [a * (y[0] - 1) + b * (y[1] - 1) for a, b in rows],
            lambda _: rows,
        )
        assert (found is not None) == proven
