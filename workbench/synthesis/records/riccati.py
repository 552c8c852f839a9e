"""Feedback from records by the Riccati equation of a game, with a line search over the multiplier.

The plants that agree with the records are centre + root(S) Delta root(G)^-1 with |Delta| <= 1. For
a multiplier alpha the S-lemma is the bounded-real inequality of

    x+ = (A + B K) x + [root(alpha S)  w] v,    z = [root(alpha G)^-1 [I; K]; C + D K] x,

and its least solution P = Y^-1 solves the discrete-time Riccati equation of a game between u and v
(T. Basar, P. Bernhard, H-infinity Optimal Control and Related Minimax Design Problems (1995),
section 3.2; I. R. Petersen, A stabilization algorithm for a class of uncertain linear systems,
Systems and Control Letters 8 (1987) 351-357). No linear matrix inequality is solved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, block_diag, solve_discrete_are
from scipy.optimize import minimize_scalar

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.records.inequalities import ProvenFeedback, ScaledRecords
from workbench.synthesis.records.program import FeedbackFromRecords
from workbench.synthesis.records.search import least_rate

STRICT = 1e-6
"""Multiple of the identity added to the weight of the state, relative to this weight."""
LARGER = 1e-4
"""Relative enlargement of the set, so that the answer's inequality is strict."""
MULTIPLIERS = np.geomspace(1e-8, 1e8, 49)
"""Multipliers of the first search, relative to the one that balances S and G."""
DOUBLINGS = 20
"""Largest number of doublings of a level until the game has a solution."""
LEVEL_ACCURACY = 1e-5
"""Relative width of a level's interval at which bisection ends."""
LINE_ACCURACY = 1e-4
"""Accuracy of the logarithm of the multiplier."""
LEVEL_RISES = (0.0, 1e-4, 1e-3, 1e-2)
"""Relative distances above the level found, tried until the checks of an answer hold."""


class GamePoint(NamedTuple):
    """A solution of the game: Y (n, n), K (m, n), the multiplier, and the level in scaled units."""

    Y: RealArray
    K: RealArray
    multiplier: float
    level: float


@method(FeedbackFromRecords, "riccati", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def riccati(program: FeedbackFromRecords, context: Context) -> Claim:
    """The Riccati equation of a game, with a line search over the multiplier."""
    game = _Game(program.scaled)

    def answer(point: GamePoint | None) -> ProvenFeedback | None:
        found = None if point is None else program.scaled.restored(*point)
        return found if found is not None and program.proven(found) else None

    if program.criterion == "decay":
        best = least_rate(lambda rate: answer(game.at(1.0, rate=rate)), context)
        if best is None:
            return None, Outcome.INFEASIBLE, "riccati: no gain stabilises every plant at rate 1"
        return best, Outcome.SOLVED, ""
    least = game.least()
    if least is None:
        return None, Outcome.INFEASIBLE, "riccati: the equation has no solution for any multiplier"
    for rise in LEVEL_RISES:
        level = least.level * (1.0 + rise)
        best = answer(game.raised(least, level))
        if best is not None:
            return best, Outcome.SOLVED, ""
    return None, Outcome.FAILED, f"riccati: the level {least.level:.6g} cannot be proven"


class _Game:
    """The game between control and disturbance for one set of scaled records."""

    def __init__(self, scaled: ScaledRecords) -> None:
        self.scaled = scaled
        self.uncertain = (1.0 + LARGER) * scaled.uncertainty
        self.spread = (1.0 + LARGER) * scaled.spread

    def at(self, multiplier: float, rate: float = 1.0, gamma: float = math.inf) -> GamePoint | None:
        """The solution of the game for a multiplier; None where it has none.

        ``rate`` is the decay rate per sample, ``gamma`` the H-infinity level.
        """
        (A, B), (C, D), n = self.scaled.plant, self.scaled.performance, self.scaled.records.order
        uncertain = self.uncertain / math.sqrt(multiplier)
        C1, D1 = np.vstack([uncertain[:, :n], C]), np.vstack([uncertain[:, n:], D])
        A, B = A / rate, B / rate
        V = np.hstack([math.sqrt(multiplier) / rate * self.spread, self.scaled.disturbance / gamma])
        Q = C1.T @ C1
        Q = Q + STRICT * np.trace(Q) / n * np.eye(n)
        R = D1.T @ D1
        across = np.hstack([C1.T @ D1, np.zeros((n, V.shape[1]))])
        try:
            both = np.hstack([B, V])
            P = solve_discrete_are(A, both, Q, block_diag(R, -np.eye(V.shape[1])), s=across)
            P = (P + P.T) / 2
            room = np.eye(V.shape[1]) - V.T @ P @ V
            np.linalg.cholesky(P)
            np.linalg.cholesky((room + room.T) / 2)
            M = P + P @ V @ np.linalg.solve(room, V.T @ P)
            K = -np.linalg.solve(R + B.T @ M @ B, B.T @ M @ A + D1.T @ C1)
            Y = np.linalg.inv(P)
        except (LinAlgError, ValueError):
            return None
        level = rate if not len(C) else gamma
        if self.scaled.criterion == "h2":
            level = math.sqrt(
                float(np.trace(self.scaled.disturbance.T @ P @ self.scaled.disturbance))
            )
        return GamePoint(Y, K, multiplier, level)

    def raised(self, point: GamePoint, level: float) -> GamePoint | None:
        """The solution with the multiplier of a point, for a level at least as high as its own."""
        if self.scaled.criterion == "hinf":
            return self.at(point.multiplier, gamma=level)
        return point._replace(level=level)

    def least(self) -> GamePoint | None:
        """The point with the least level over all multipliers; None if no multiplier has a
        solution.
        """
        h, e = self.scaled.sizes
        tried = e / h * MULTIPLIERS
        points = [self._least_at(multiplier, 100 * LEVEL_ACCURACY) for multiplier in tried]
        levels = [math.inf if point is None else point.level for point in points]
        k = int(np.argmin(levels))
        if points[k] is None:
            return None

        def level(logarithm: float) -> float:
            found = self._least_at(math.exp(logarithm), LEVEL_ACCURACY)
            return levels[k] * 1e3 if found is None else found.level

        ends = np.log(tried[[max(k - 1, 0), min(k + 1, len(tried) - 1)]])
        line = minimize_scalar(
            level, bounds=tuple(ends), method="bounded", options={"xatol": LINE_ACCURACY}
        )
        fine = self._least_at(math.exp(line.x), LEVEL_ACCURACY)
        return points[k] if fine is None or fine.level > levels[k] else fine

    def _least_at(self, multiplier: float, accuracy: float) -> GamePoint | None:
        """The point with the least level for one multiplier."""
        best = self.at(multiplier)
        if best is None or self.scaled.criterion == "h2":
            return best
        # Every level is at least the one that the first step of the noise causes.
        first = self.scaled.disturbance.T @ np.linalg.inv(best.Y) @ self.scaled.disturbance
        low = math.sqrt(float(np.linalg.norm(first, 2)))
        high, best = low, None
        for _ in range(DOUBLINGS):
            high *= 2.0
            best = self.at(multiplier, gamma=high)
            if best is not None:
                break
            low = high
        while best is not None and high / low > 1.0 + accuracy:
            middle = math.sqrt(low * high)
            found = self.at(multiplier, gamma=middle)
            low, high = (middle, high) if found is None else (low, middle)
            best = found or best
        return best
