"""Checks of the switched loops: their results computed again in other ways."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import eigh

from workbench import Check
from workbench.synthesis import SwitchedLoop, closed_loop_transition, discretise
from workbench.types import Dataset, RealArray

from ...drive.plants import ANTIALIASING
from ...drive.red_book import envelope
from ...laboratory.bench_setup import PERIOD
from ..switched_loop import MICRO
from .switched_drives import DEFECTS, SwitchedDrives

DECREASE = 1.0 - 1e-9
"""Largest ratio of V after a stay to V before it; below 1 by more than its rounding."""
PARAMETRIC_PLANTS = 200
"""Number of random plants of the parametric set."""
DEFECT_LENGTHS = (1, 2, 5, 20, 100)
"""Lengths [samples] of the defects with which random plants are checked."""
PRINTED = {"gain_margin": (3.0, 1.0), "phase_margin": (8.0, 2.0)}
"""Margins of K (1 - F) in figure 8.10, and the largest accepted differences from them: dB and
degrees.
"""
POLE_TOLERANCE = 1e-6
"""Largest accepted difference between two computations of a pole."""
OPTICS_TOLERANCE = 0.01
"""Accepted change, relative, of a tenth of the largest error by the optics' nonlinearity."""
MORE_FREQUENCIES = 131
"""Number of frequencies at which the error of one defect is computed again."""
FREQUENCY_TOLERANCE = 0.02
"""Largest accepted relative excess of an error over that at the stored frequencies."""


def switching_checks(drives: SwitchedDrives, answer: Dataset) -> list[Check]:
    """Check loops, functions, bounds, simulations and cells of an answer."""
    found = [
        _loops(drives),
        *(_functions(drives, answer, each) for each in answer["strategy"].values),
    ]
    found += [_ordered(answer), _bounded(answer), _in_laboratory(answer)]
    found += [_replayed(drives, answer)]
    found += [
        _errors_between_frequencies(drives, answer),
        _cells(drives, answer),
        _in_cells(drives, answer),
    ]
    return found + _figure(drives, answer)


def _loops(drives: SwitchedDrives) -> Check:
    """Compare the poles of every clean loop with those of the loop of u -> f_en and K."""
    K = discretise(drives.reference, PERIOD)
    worst, where = 0.0, ""
    for (name, G), loop in zip(drives.alone.plants.items(), drives.loops("open"), strict=False):
        expected = _sorted(np.linalg.eigvals(closed_loop_transition(G, K, drives.delay)))
        found = _sorted(np.linalg.eigvals(loop.clean[0]))
        off = float(abs(expected - found).max())
        worst, where = max((worst, where), (off, f"of {name}"))
    statement = "largest distance of a switched loop's pole from that of the loop in eq. 3.18 [1]"
    return Check("loops", statement, worst, POLE_TOLERANCE, where=where)


def _sorted(poles: Any) -> Any:
    return np.sort_complex(poles)


def _functions(drives: SwitchedDrives, answer: Dataset, strategy: str) -> Check:
    """Check by generalised eigenvalues that V decreases over every allowed stay."""
    worst, where = 0.0, ""
    one = answer.sel(strategy=strategy)
    loops = drives.loops(strategy)
    for i, loop in enumerate(loops):
        P = answer[f"P_{strategy}"].values[i]
        value = _worst(loop, P, int(one["dwell"][i]), drives.longest)
        worst, where = max((worst, where), (value, f"for {one['drive'].values[i]}"))
    if "dwell_common" in one:
        P = answer[f"P_common_{strategy}"].values
        for i, loop in enumerate(loops):
            value = _worst(loop, P, int(one["dwell_common"]), drives.longest)
            name = f"for {one['drive'].values[i]}, one set of functions"
            worst, where = max((worst, where), (value, name))
    statement = "largest V at the next entry, or after a sample of the clean mode, over V before"
    over = "for every stay that is allowed, for these 12 drives"
    return Check(f"functions, {strategy}", statement, worst, DECREASE, where=where, over=over)


def _worst(loop: SwitchedLoop, P: RealArray, dwell: int, longest: int) -> float:
    (A_c, _), (A_o, _) = loop.clean, loop.defect
    if (
        min(np.linalg.eigvalsh(each / np.outer(*[np.sqrt(np.diag(each))] * 2))[0] for each in P)
        <= 0
    ):
        return np.inf
    found = [_ratio(A_c, P[0], P[0]), _ratio(np.linalg.matrix_power(A_c, dwell), P[1], P[0])]
    power = np.eye(len(A_o))
    for _ in range(longest):
        power = A_o @ power
        found.append(_ratio(power, P[0], P[1]))
    return max(found)


def _ratio(A: RealArray, after: RealArray, before: RealArray) -> float:
    """Largest generalised eigenvalue of (A' after A, before), in units of its diagonal."""
    units = np.sqrt(np.diag(before))
    M = (A / units).T @ after @ (A / units)
    return float(eigh((M + M.T) / 2, before / np.outer(units, units), eigvals_only=True)[-1])


def _ordered(answer: Dataset) -> Check:
    """Check that no distance is proven that a periodic switching sequence makes unstable."""
    less = (answer["unstable"] + 1 - answer["dwell"]).max()
    statement = "distance that periodic defects make unstable + 1 - the proven distance [samples]"
    return Check("dwell", statement, float(less), 0.0)


def _bounded(answer: Dataset) -> Check:
    bound = answer["bound"].sel(length=answer["played"].values, distance=answer["spaced"].values)
    over = answer["simulated"].max("drive").values / bound.values
    statement = "largest simulated error over its bound"
    return Check("bounds", statement, float(over.max()), 1.0 + 1e-9)


def _in_laboratory(answer: Dataset) -> Check:
    """Compare with the laboratory, for a disc with so small a deviation that the optics
    are linear.
    """
    bound = answer["bound"].sel(case="rotation", length=answer["tested"].values).isel(distance=-1)
    small = answer["laboratory"].isel(size=0).max("drive")
    over = small.values / float(small["size"]) / bound.values
    statement = "largest error in the laboratory over its bound, both for a small disc"
    return Check("laboratory", statement, float(over.max()), 1.0 + OPTICS_TOLERANCE)


def _replayed(drives: SwitchedDrives, answer: Dataset) -> Check:
    """Simulate six defects again, sample by sample and for many phases."""
    off, where = 0.0, ""
    distances = answer["spaced"].values
    for strategy in answer["strategy"].values:
        loop = drives.loops(strategy)[0]
        case, samples, distance = "rotation", int(answer["played"][-2]), int(distances[2])
        one = answer["simulated"].sel(strategy=strategy, case=case, played=samples)
        told = float(one.isel(drive=0).sel(spaced=distance))
        again = _played(drives, loop, case, samples, distance)
        off, where = max((off, where), (abs(again / told - 1), f"of {strategy}"))
    statement = "largest error of defects played sample by sample over the stored one, less 1"
    return Check("replay", statement, off, 0.005, where=where)


def _played(
    drives: SwitchedDrives, loop: SwitchedLoop, case: str, samples: int, distance: int
) -> float:
    """Largest |w - lens x| for discs at 64 phases, beginning in the steady motion of the loop."""
    amplitude, omega = drives.disc(case)
    worst = 0.0
    for a, w in zip(amplitude, omega, strict=True):
        filtered = ANTIALIASING / np.hypot(ANTIALIASING, w)
        lag = np.arctan2(w, ANTIALIASING)
        phase = 2 * np.pi * np.arange(64) / 64
        (A, B), n = loop.clean, len(loop.clean[0])
        # The steady motion c cos + s sin solves a real system of twice the size.
        cosine, sine = np.cos(w * PERIOD) * np.eye(n) - A, np.sin(w * PERIOD) * np.eye(n)
        big = np.block([[cosine, -sine], [sine, cosine]])
        side = a * filtered * np.concatenate([B[:, 0] * np.cos(lag), -B[:, 0] * np.sin(lag)])
        c, s = np.split(np.linalg.solve(big, side), 2)
        x = np.outer(c, np.cos(phase)) - np.outer(s, np.sin(phase))
        k = 0
        false = drives.false * np.sin(2 * np.pi * (np.arange(samples) + 0.5) / samples)
        for _ in range(DEFECTS):
            for stay, mode in ((samples, loop.defect), (distance, loop.clean)):
                for i in range(stay):
                    angle = w * k * PERIOD + phase
                    worst = max(worst, float(abs(a * np.cos(angle) - loop.output[0] @ x).max()))
                    seen = a * filtered * np.cos(angle - lag)
                    seen = seen + (false[i] if mode is loop.defect else 0.0)
                    x = mode[0] @ x + mode[1] * seen
                    k += 1
    return worst


def _errors_between_frequencies(drives: SwitchedDrives, answer: Dataset) -> Check:
    """Compare errors of one defect at more frequencies with those at the stored ones."""
    worst, where = 0.0, ""
    for strategy in answer["strategy"].values:
        loop = drives.loops(strategy)[0]
        root = np.linalg.cholesky(answer[f"P_{strategy}"].values[0, 0])
        at = drives.deviations(loop, "envelope")
        omega = np.geomspace(at.omega[0], at.omega[-1], MORE_FREQUENCIES)
        amplitude = envelope(drives.axis, omega / (2 * np.pi)) / MICRO
        more = replace(at, amplitude=amplitude, omega=omega)
        value = float((more.single_defect_error(root) / at.single_defect_error(root)).max())
        worst, where = max((worst, where), (value, f"of {strategy}"))
    statement = (
        f"largest error of one defect at {MORE_FREQUENCIES} frequencies over that stored, CD1"
    )
    return Check("frequencies", statement, worst, 1.0 + FREQUENCY_TOLERANCE, where=where)


def _cells(drives: SwitchedDrives, answer: Dataset) -> Check:
    """Check that the cells lie in the box, do not overlap, and fill the stored share of it."""
    low, high = drives.box(float(answer["box_of_cells"])).ends
    # coordinates in which the box is from 0 to 1
    a, b = ((answer[f"cell_{end}"].values - low) / (high - low) for end in ("low", "high"))
    beyond = max((-a).max(initial=0.0), (b - 1.0).max(initial=0.0))
    shared = np.minimum(b[:, None], b) - np.maximum(a[:, None], a)
    overlap = np.maximum(shared, 0.0).prod(axis=-1).sum() - (b - a).prod(axis=1).sum()
    share = float(answer["box_volume"].sel(box_share=float(answer["box_of_cells"])))
    off = abs((b - a).prod(axis=1).sum() - share)
    statement = "cells beyond the set, on each other, and their volume off the stored one, relative"
    return Check("cells", statement, float(max(beyond, overlap, off)), 1e-9)


def _in_cells(drives: SwitchedDrives, answer: Dataset) -> Check:
    """Check that V decreases from defect to defect at random plants of the set."""
    box = drives.box(float(answer["box_of_cells"]))
    low, high = box.ends
    rng = np.random.default_rng(0)
    worst, where = 0.0, ""
    whole = float(answer["box_volume"].sel(box_share=float(answer["box_of_cells"]))) > 1.0 - 1e-9
    missing = np.inf if whole else 0.0  # if the whole set is proven, no plant may be missing
    cells = list(zip(answer["cell_low"].values, answer["cell_high"].values, strict=True))
    for point in rng.uniform(low, high, (PARAMETRIC_PLANTS, 3)):
        inside = [i for i, (a, b) in enumerate(cells) if (a <= point).all() and (point <= b).all()]
        if not inside:
            worst = max(worst, missing)
            continue
        P, dwell = (answer[name].values[inside[0]] for name in ("cell_P", "cell_dwell"))
        value = _cycle(*box.at(point), P, int(dwell))
        worst, where = max((worst, where), (value, f"at g, k1, k2 = {point.round(4).tolist()}"))
    statement = "largest V of random plants a sample or a defect and a dwell later over V before"
    over = "for random plants of the set"
    return Check("plants of the set", statement, worst, DECREASE, where=where, over=over)


def _cycle(A_c: RealArray, A_o: RealArray, P: RealArray, dwell: int) -> float:
    """Largest V of either mode after a sample, or after a defect and a stay, over V before."""
    longer = [_ratio(np.linalg.matrix_power(A_o, n), P[0], P[1]) for n in DEFECT_LENGTHS]
    back = _ratio(np.linalg.matrix_power(A_c, dwell), P[1], P[0])
    return max(_ratio(A_c, P[0], P[0]), _ratio(A_o, P[1], P[1]), back * max(longer))


def _figure(drives: SwitchedDrives, answer: Dataset) -> list[Check]:
    """Compare the margins of the focus loop with figure 8.10."""
    if drives.axis != "focus":
        return []
    one = answer.sel(controller="K (1 - F)", sampling="sampled", plant="nominal")
    return [
        Check(
            f"figure 8.10, {name.replace('_', ' ')}",
            f"distance from {printed:g} {one[name].attrs['units']}, sampled without delay",
            abs(float(one[name]) - printed),
            near,
        )
        for name, (printed, near) in PRINTED.items()
    ]
