"""Inputs that move together: the record does not show the effect of each of them alone.

Source: D. Belsley, E. Kuh, R. Welsch, Regression Diagnostics, 1980, chapter 3 (the variance of a
gain grows as one over the share of its input that the other inputs do not explain).
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import resolution
from workbench.identification.record_tests.record import RecordData

TOGETHER = 1e-2
"""An input's gain is hard to determine if less than this share of its variance is independent of
the other inputs.
"""
INSEPARABLE = 1e-10
"""An independent share below this counts as rounding."""
WEIGHTY = 1e-3
"""Another input is named if it has at least this share in an input."""


def independent_inputs(record: RecordData) -> TestedAssumption:
    """Test whether the inputs move independently of each other."""
    assumption = "inputs move apart"
    record = unflagged(record)
    if record.u.shape[1] < 2:
        return TestedAssumption(assumption, "there is one input")
    share, partners, coarse = own_shares(record.u)
    worst = int(np.argmin(share))
    told = f"{share[worst]:.2g} of the variance of {record.inputs[worst]!r} is its own"
    found, named = [], set()
    for j in np.argsort(share):
        group = frozenset([int(j), *partners[j]])
        if share[j] >= TOGETHER or group in named:
            continue
        named.add(group)
        names = " and ".join(repr(record.inputs[k]) for k in sorted(group))
        found.append(
            Finding(
                "collinear inputs",
                f"{names} move together: {share[j]:.1g} of the variance of {record.inputs[j]!r} is "
                "not the others', so that their separate gains cannot be told"
                if share[j] < INSEPARABLE or coarse[j]
                else f"{names} move together: only {share[j]:.1g} of the variance of "
                f"{record.inputs[j]!r} is its own, and the variance of its gain is "
                f"{1 / share[j]:.2g} times as large",
                f"inputs {names}, whole record",
                float(share[j]),
                "share of the input's variance that is its own",
                "move the inputs one by one, or by signals of their own; or leave one out and read "
                "the other's gain as that of both",
                forbids=bool(share[j] < INSEPARABLE or coarse[j]),
            )
        )
    return TestedAssumption(assumption, told, findings=tuple(found))


def own_shares(u: RealArray) -> tuple[RealArray, list[list[int]], list[bool]]:
    """Share (nu,) of each input's variance (N, nu) that the other inputs do not explain.

    Also returned for each input: the other inputs that explain it, and whether its independent part
    lies within the steps of its converter.
    """
    spread = u.std(axis=0)
    spread[spread == 0] = 1.0
    scaled = (u - u.mean(axis=0)) / spread
    # The triangular factor keeps digits that the squares of the inputs would lose.
    triangle = np.asarray(np.linalg.qr(scaled / np.sqrt(len(u)), mode="r"))
    nu = u.shape[1]
    share, partners, coarse = np.ones(nu), [], []
    for j in range(nu):
        others = [k for k in range(nu) if k != j]
        weight = np.linalg.lstsq(triangle[:, others], triangle[:, j], rcond=None)[0]
        left = triangle[:, j] - triangle[:, others] @ weight
        whole = float(triangle[:, j] @ triangle[:, j])
        share[j] = float(left @ left) / whole if whole else 1.0
        partners.append([k for k, w in zip(others, weight, strict=True) if abs(w) > WEIGHTY])
        coarse.append(False)
        if share[j] < TOGETHER:
            own = np.abs(scaled[:, j] - scaled[:, others] @ weight)
            steps = np.array([resolution(u[:, k]) for k in range(nu)]) / spread
            allowed = steps[j] + np.abs(weight) @ steps[others]
            coarse[j] = bool(steps[j] > 0 and own.max() <= allowed)
    return share, partners, coarse
