"""C code in fixed point at its limits: it stays within them, and no integer overflows."""

import control
import numpy as np
import pytest
from compiled_code import Compiled, needs_compiler

from workbench.errors import InputError
from workbench.synthesis.implementation.c_code.c_fixed_point import fixed_header
from workbench.synthesis.implementation.fixed_point import fixed_point
from workbench.synthesis.implementation.implemented import FixedFormat, ImplementedController
from workbench.synthesis.implementation.rounding import Rounding
from workbench.synthesis.implementation.second_order import second_order_sections

T, BITS, SIGNAL_BITS = 0.01, 20, 24
STEP = 2.0 ** (1 - SIGNAL_BITS)


def board(K, folder):
    """The compiled code of K, full scales being 1, and its cascades."""
    fixed = fixed_point(second_order_sections(K), BITS, SIGNAL_BITS)
    form = FixedFormat(BITS, SIGNAL_BITS, 1.0, 1.0)
    none = Rounding(0.0, 0.0)
    answer = ImplementedController(
        fixed.lti, "as given", "fixed", 1.0, None, (), none, fixed=fixed, format=form
    )
    return Compiled(answer, folder), fixed


def random_controller(rng, inputs, outputs):
    n = int(rng.integers(1, 6))
    A = rng.normal(size=(n, n))
    A *= rng.uniform(0.3, 0.999) / np.abs(np.linalg.eigvals(A)).max()
    B, C = rng.normal(size=(n, inputs)), rng.normal(size=(outputs, n))
    return control.ss(A, B, 0.3 * C, 0.3 * rng.normal(size=(outputs, inputs)), T)


@pytest.mark.cases(1)
@needs_compiler
@pytest.mark.parametrize("seed", range(8))
def test_controls_are_those_of_the_controller_until_they_saturate(seed, tmp_path):
    """The compiled code ends at the first integer that overflows; it never does."""
    rng = np.random.default_rng(seed)
    inputs, outputs = (int(k) for k in rng.integers(1, 4, 2))
    made, fixed = board(random_controller(rng, inputs, outputs), tmp_path)
    quiet = fixed.lti
    x, off, size = np.zeros(quiet.nstates), 0.0, 0.0
    gain = 0.5 / np.abs(control.impulse_response(quiet, T=np.arange(400) * T).y).sum()
    for _ in range(300):
        y = np.rint(gain * rng.choice([-1.0, 1.0], inputs) / STEP) * STEP
        wanted = quiet.C @ x + quiet.D @ y
        x = quiet.A @ x + quiet.B @ y
        off = max(off, np.abs(made.step(y) - wanted).max())
        size = max(size, np.abs(wanted).max())
    noise = sum(one.noise for line in fixed.cascades for one in line)
    assert size < 1.0 and off < 8.0 * noise + 2.0 * STEP
    for _ in range(2000):  # whatever comes, also of full scale for long
        y = np.full(inputs, rng.choice([-1.0, 1.0])) if rng.uniform() < 0.9 else rng.uniform(-1, 1)
        assert (np.abs(made.step(np.broadcast_to(y, inputs) * (1 - STEP))) < 1.0).all()
    for _ in range(20):
        y, u = rng.uniform(-0.1, 0.1, inputs), rng.uniform(-1, 1, outputs)
        made.take(y, u)
        assert (np.abs(made.step(y)) < 1.0).all()


@needs_compiler
@pytest.mark.parametrize("inputs", [1, 3])
def test_it_takes_over_at_any_control_that_memories_can_hold(inputs, tmp_path):
    K = control.ss(
        np.diag(0.9 - 0.1 * np.arange(inputs)), np.eye(inputs), np.full((1, inputs), 0.05), 0.0, T
    )
    K = control.ss(K.A, K.B, K.C, np.full((1, inputs), 0.2), T)
    made, _ = board(K, tmp_path)
    for y, u in ((0.1, 0.3), (-0.2, 0.3), (0.0, -0.5)):
        made.take(np.full(inputs, y), [u])
        assert made.step(np.full(inputs, y)) == pytest.approx([u], abs=20 * inputs * STEP)


@needs_compiler
def test_an_integrator_neither_overflows_nor_winds_up(tmp_path):
    made, fixed = board(control.ss(1.0, 0.01, 1.0, 0.3, T), tmp_path)
    assert fixed.overflow_free
    for _ in range(5000):
        u = made.step([0.5])
    assert u == pytest.approx(1.0)
    assert made.step([-0.5]) < 0.75  # at once, though the error had one sign for 50 s


@needs_compiler
def test_what_the_sum_loses_is_taken_from_every_channel(tmp_path):
    """Two slow channels together at the limit: they leave it sooner than each by itself."""
    K = control.ss(np.diag([0.99, 0.99]), 0.02 * np.eye(2), [[1.0, 1.0]], [[0.1, 0.1]], T)
    made, _ = board(K, tmp_path)
    x = np.zeros(2)
    for _ in range(1000):
        y = np.full(2, 0.9)
        made.step(y)
        x = K.A @ x + K.B @ y
    untold, told = 0, 0
    while (K.C @ x + K.D @ np.zeros(2)).item() > 0.5:
        x, untold = K.A @ x, untold + 1
    while made.step(np.zeros(2)).item() > 0.5:
        told += 1
    assert told < 0.6 * untold


def test_integrators_of_two_measurements_are_refused():
    """Their values would run apart: only their sum is seen."""
    K = control.ss(np.eye(2), np.eye(2), [[1.0, -1.0]], np.zeros((1, 2)), T)
    fixed = fixed_point(second_order_sections(K), BITS, SIGNAL_BITS)
    with pytest.raises(InputError, match="several measurements lead to its control"):
        fixed_header(fixed, BITS, SIGNAL_BITS, (1.0, 1.0))
