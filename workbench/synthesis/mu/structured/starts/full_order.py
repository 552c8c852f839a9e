"""Starts from a controller of full order: reduced to an order, or replaced by the nearest
members.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.executor.clock import clocked_by
from workbench.mu import Peak
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.h_infinity.riccati import central_of
from workbench.synthesis.h_infinity.singular_plants.regularised import on_regular
from workbench.synthesis.mu.dk import LEVEL_TOLERANCE, iterated
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.synthesis.reduction import truncation
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.systems.norms import stable
from workbench.systems.realisation import Matrices, realisation

DETOUR = 6
"""Largest number of states above the wanted order from which another reduction starts."""
SHARE_OF_TIME = 0.5
"""Share of the remaining time that an iteration for a start may take."""


def full_order_starts(search: Search) -> Iterator[StateSpace]:
    """The nearest members to the H-infinity controller; for an order, a reduced D-K controller."""
    if isinstance(search.family, Modal):
        yield from _reduced_to_order(search.program, search.family.order, search.context)
    else:
        yield from search.members(_central(search.program))


def _central(program: MuSynthesis) -> Iterator[StateSpace]:
    """The H-infinity controller of the plant, which is made regular if needed."""
    try:
        made = on_regular(program.plant, lambda normal: central_of(normal, LEVEL_TOLERANCE))
    except (SolverError, InputError):
        return
    yield realisation(made.K, 0.0)


def _reduced_to_order(program: MuSynthesis, order: int, context: Context) -> Iterator[StateSpace]:
    """Approximations, with the wanted order, of a D-K controller and of the H-infinity controller.

    The latter has few states, since it contains no scalings. Without a perturbation it is the
    only one.
    """
    if program.structure is None:
        for K in _central(program):
            if _stable(program, K):
                yield from _approximations(program, order, K, None)
        return
    for found in (_dk_answer(program, context), _answered_central(program)):
        if found is not None and found.peak is not None:
            yield from _approximations(program, order, found.K, found.peak)


def _stable(program: MuSynthesis, K: StateSpace) -> bool:
    """Whether the loop is determined and stable."""
    try:
        return stable(program.plant.close(K).A)
    except InputError:
        return False


def _answered_central(program: MuSynthesis) -> MuController | None:
    """The H-infinity controller as an answer; None if there is none or it does not stabilise."""
    K = next(_central(program), None)
    try:
        return None if K is None else program.answer(K)
    except SolverError:  # rounding hides whether the loop is stable
        return None


def _approximations(
    program: MuSynthesis, order: int, K: StateSpace, peak: Peak | None
) -> Iterator[StateSpace]:
    """Approximations of a controller with the wanted order; ``peak`` is that of its loop."""
    if K.nstates <= order:
        yield K
        return
    parts: Matrices = (K.A, K.B, K.C, K.D)
    loop = program.plant.close(K)
    closed: Matrices = (loop.A, loop.B, loop.C, loop.D)
    ways: list[tuple[int, Callable[[int], Matrices]]] = [
        (0, truncation.weighted(parts, program.plant, closed, peak)),
        truncation.balanced_truncation(kept_and_stable(parts)),
        truncation.matchdc(kept_and_stable(parts)),
        truncation.hankel(kept_and_stable(parts)),
    ]
    for least, way in ways:
        if least <= order:
            yield realisation(way(order), 0.0)
    for higher in range(order + 1, min(order + DETOUR, K.nstates - 1) + 1):
        for least, way in ways:
            if least > higher:
                continue
            fewer, again = truncation.balanced_truncation(kept_and_stable(way(higher)))
            if fewer <= order:
                yield realisation(again(order), 0.0)


def _dk_answer(program: MuSynthesis, context: Context) -> MuController | None:
    """The answer of D-K iteration within a share of the remaining time; None if it has none."""
    try:
        left = SHARE_OF_TIME * context.seconds_left("D-K for a start")
        options = replace(context.options, time_limit=None if np.isinf(left) else max(left, 1e-3))
        own = Context(options=options)
        with clocked_by(own):
            # the best states to remove depend on the final order, which is lower
            answer, _, _ = iterated(program.without_demands(), own, 0.0, reduces=False)
    except (SolverError, InputError):
        return None
    return answer
