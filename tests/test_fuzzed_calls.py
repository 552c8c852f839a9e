"""Thousands of wrong calls of public functions: an answer, or an error of ours that names it."""

import time
import traceback
import warnings

import numpy as np
import pytest
from fuzzed_calls import FUNCTIONS, SOLVED
from fuzzed_values import fuzzed

import workbench as wb
from workbench.answer import Answer
from workbench.errors import WorkbenchError

TRIALS, FEW = 9000, 300
"""Calls in the slow lane, and in the quick one."""
HANGS = 20.0
"""Processor seconds that no call may take."""


def used(found):
    """What one does with an answer: read it, and ask for its certificate."""
    repr(found)
    if isinstance(found, SOLVED):
        repr(wb.solve(found))
    if isinstance(found, Answer):
        return found.holds
    return None


def trial(seed):
    """A call with one or two arguments replaced; what was wrong with what became of it, or None."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(list(FUNCTIONS)))
    function, right = FUNCTIONS[name]
    arguments = dict(right)
    chosen = rng.choice(list(right) or [""], min(int(rng.integers(1, 3)), len(right)), False)
    for one in chosen:
        arguments[str(one)] = fuzzed(right[one], rng)
    begun = time.process_time()
    try:
        used(function(**arguments))
    except WorkbenchError as error:
        try:
            str(error).encode()
        except UnicodeEncodeError:
            return f"{seed} {name}: cannot be printed: {error!a}"
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)
        if isinstance(error, TypeError) and len(where) == 1:
            return None  # arguments that the signature does not have
        changed = {one: repr(arguments[one])[:80] for one in map(str, chosen)}
        ours = [one for one in where if "/workbench/" in one.filename] or where
        place = f"{ours[-1].filename.rpartition('/workbench/')[2]}:{ours[-1].lineno}"
        told = f"{type(error).__name__}: {str(error)[:100]!a}"
        return f"{seed} {name}: {told} at {place} of {changed!a}"
    if time.process_time() - begun > HANGS:
        return f"{seed} {name}: {time.process_time() - begun:.0f} s of processor time"
    return None


def raw(seeds):
    """What went wrong in the trials of these seeds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as a user sees them: they do not end a call
        return [found for found in map(trial, seeds) if found is not None]


@pytest.mark.parametrize("seed", [9687, 13888, 17850, 19283, 20950, 22189, 22742])
def test_calls_that_once_ended_badly(seed):
    assert not raw([seed])


@pytest.mark.parametrize("part", range(6))
def test_a_few_wrong_calls(part):
    assert not raw(range(part * FEW // 6, (part + 1) * FEW // 6))


@pytest.mark.slow
def test_wrong_calls():
    found = raw(range(TRIALS))
    print(f"{TRIALS} calls, {len(found)} raw tracebacks", *found, sep="\n")
    assert not found
