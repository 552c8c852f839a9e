"""Questions whose answers are known in closed form, and what became of an answer.

The truth is derived by hand for each family and computed in ball arithmetic of 400 bits from the
doubles that the library is given, so that a claim is false only where it is proven to be.
"""

import functools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq

from workbench.errors import WorkbenchError

BITS = 400
"""Precision of truths."""
HANGS = 20.0
"""Processor seconds after which a question counts as refused badly."""


@dataclass(frozen=True)
class Claim:
    """That the number ``truth`` lies between ``lower`` and ``upper``."""

    name: str
    lower: float
    upper: float
    truth: arb

    @property
    def is_false(self):
        return bool(arb(self.lower) > self.truth) or bool(arb(self.upper) < self.truth)

    @property
    def is_number(self):
        return not math.isnan(self.lower) and not math.isnan(self.upper)


@dataclass(frozen=True)
class Case:
    """``ask()`` puts the question: the answer, and what it claims."""

    family: str
    function: str
    ask: Callable[[], tuple[Any, list[Claim]]]


@dataclass(frozen=True)
class Verdict:
    """What became of a question; ``word`` is one of `WORDS`."""

    word: str
    told: str


WORDS = ("true", "refused", "false", "unproven", "traceback", "no number", "hangs")
BAD = WORDS[3:]
"""What counts as refused badly."""


def judged(case):
    """The verdict of a case."""
    begun = time.process_time()
    try:
        answer, claims = case.ask()
        held = getattr(answer, "holds", True)
    except WorkbenchError as error:
        word = "refused" if 15 < len(str(error)) < 800 else "traceback"
        return Verdict(word, f"{type(error).__name__}: {error}")
    except Exception as error:
        return Verdict("traceback", f"{type(error).__name__}: {error}")
    if wrong := [one for one in claims if one.is_false]:
        return Verdict("false", str(wrong))
    if any(not one.is_number for one in claims):
        return Verdict("no number", str(claims))
    if not held:
        return Verdict("unproven", str(answer.certificate.failures))
    if time.process_time() - begun > HANGS:
        return Verdict("hangs", f"{time.process_time() - begun:.0f} s of processor time")
    return Verdict("true", str(claims))


def table(found: Iterable[tuple[Case, Verdict]]):
    """How many cases of each family and function became what, as lines of text."""
    counts = Counter((case.family, case.function, verdict.word) for case, verdict in found)
    rows = sorted({key[:2] for key in counts})
    lines = [f"{'family':<26}{'function':<24}" + "".join(f"{word:>10}" for word in WORDS)]
    for row in rows:
        cells = "".join(f"{counts[(*row, word)] or '':>10}" for word in WORDS)
        lines.append(f"{row[0]:<26}{row[1]:<24}{cells}")
    total = Counter(word for *_, word in counts.elements())
    lines.append(f"{'all':<50}" + "".join(f"{total[word]:>10}" for word in WORDS))
    return "\n".join(lines)


# --- exact numbers --------------------------------------------------------------------------------


def ball(value):
    """A fraction, a double or an integer in ball arithmetic."""
    if isinstance(value, arb):
        return value
    if isinstance(value, float) and not math.isfinite(value):
        return arb(value)
    value = Fraction(value)
    return arb(fmpq(value.numerator, value.denominator))


def precise(function):
    """The function, computed with `BITS`."""

    @functools.wraps(function)
    def inner(*args, **kwargs):
        with ctx.workprec(BITS):
            return function(*args, **kwargs)

    return inner


def root(value):
    """The square root; of what cannot be told from 0, a ball about 0."""
    value = ball(value)
    return arb(0) if value == 0 else value.sqrt()


def larger(*values):
    """The largest of numbers."""
    found = ball(values[0])
    for value in map(ball, values[1:]):
        found = found.max(value)
    return found


def smaller(*values):
    """The smallest of numbers."""
    return -larger(*(-ball(value) for value in values))


def largest_ratio(above, below):
    """The maximum over x >= 0 of (a0 + a1 x + a2 x^2) / (b0 + b1 x + b2 x^2), b positive."""
    a0, a1, a2 = map(Fraction, above)
    b0, b1, b2 = map(Fraction, below)
    found = [ball(a0 / b0)]
    if b2:
        found.append(ball(a2 / b2))
    p, q, r = a2 * b1 - a1 * b2, 2 * (a2 * b0 - a0 * b2), a1 * b0 - a0 * b1
    places = []
    if p:
        square = q * q - 4 * p * r
        if square >= 0:
            places = [(-ball(q) + sign * root(square)) / (2 * ball(p)) for sign in (1, -1)]
    elif q:
        places = [ball(-r / q)]
    inner = [_quadratic(a0, a1, a2, x) / _quadratic(b0, b1, b2, x) for x in places if x > 0]
    return larger(*found, *inner)


def _quadratic(c0, c1, c2, x):
    return (ball(c2) * x + ball(c1)) * x + ball(c0)


# --- random doubles with few bits -----------------------------------------------------------------


def dyadic(rng, low=-3, high=3, bits=4):
    """A positive double of few bits between 2^low and 2^high."""
    mantissa = int(rng.integers(2 ** (bits - 1), 2**bits))
    return math.ldexp(mantissa, int(rng.integers(low, high + 1)) - bits)


def power(rng, decades=100):
    """A power of two of up to so many decades, either way."""
    most = int(decades * math.log2(10))
    return math.ldexp(1.0, int(rng.integers(-most, most + 1)))


def mixed(rng, A, B, C, steps=6, largest=3):
    """A, B and C in other coordinates, by integer steps; as they are where doubles do not hold it.

    The transformation is exact: each step adds a multiple of a row to another one and subtracts
    that of the columns.
    """
    n = len(A)
    exact = [[[Fraction(float(x)) for x in row] for row in part] for part in (A, B, C)]
    rows, inputs, outputs = (np.array(part, dtype=object) for part in exact)
    if n > 1:
        for _ in range(int(rng.integers(0, steps + 1))):
            i, j = (int(k) for k in rng.choice(n, 2, replace=False))
            factor = int(rng.integers(1, largest + 1)) * int(rng.choice([-1, 1]))
            rows[i] = rows[i] + factor * rows[j]
            inputs[i] = inputs[i] + factor * inputs[j]
            rows[:, j] = rows[:, j] - factor * rows[:, i]
            outputs[:, j] = outputs[:, j] - factor * outputs[:, i]
    parts = [part.astype(float) for part in (rows, inputs, outputs)]
    same = all(
        Fraction(one) == other
        for part, its in zip(parts, (rows, inputs, outputs), strict=True)
        for one, other in zip(part.ravel().tolist(), its.ravel().tolist(), strict=True)
    )
    return parts if same else [np.asarray(part, float) for part in (A, B, C)]
