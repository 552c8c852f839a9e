"""Checks of sensitivities and margins: closed-loop poles and formulas instead of responses.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from workbench import Check
from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import Dataset, StateSpace
from workbench.program import worst

from ...drive.plants import Gain, controller, responses
from ...drive.tables import Axis, Values
from ..control_problem import LEAK, WEIGHTS
from ..loops import SCALES

ASIDE = 1e-3
"""How far beside a gain limit the poles must be on the right side, relative."""
ON_BOUNDARY = 1e-6
"""Distance of the critical pole from its place on the boundary, relative to its frequency."""
CLOSE = 5e-3
"""How far a certified peak may lie above what formulas reach, relative."""
ABOUT = 0.25
"""What "approx." may mean: relative distance from the thesis' round frequencies."""
FAILS_BELOW = 500.0
"""Frequency [Hz] below which a third of the gain is said to fail."""
LIMITS_HZ = (100.0, 4000.0)
"""Where the loop is said to oscillate as the gain is lowered and raised [Hz]."""
DELAYS = {"table_a4": 1.0, "bandwidth": 2.0}
"""Delay [samples] beyond the hold's that may explain what the sampled loop alone does not."""
UNRELATED = 0.5
"""Correlation below which the drives' tables do not give Table A.4's order."""


def independent_checks(
    answer: Dataset,
    loops: dict[str, dict[str, StateSpace]],
    axis: Axis,
    gain: Gain,
    values: Values,
    numbers: dict[str, float],
) -> list[Check]:
    """Gain limits by closed-loop poles, certified peaks by the printed formulas."""
    wrong, away = [], []
    for loop, systems in loops.items():
        for drive, system in systems.items():
            one = answer.sel(loop=loop, drive=drive)
            for side, out in (("decrease", 1 - ASIDE), ("increase", 1 + ASIDE)):
                limit, place = float(one[side]), f"{drive}, {loop}, {side}"
                wrong += [(not _stable(system, limit / out), place)]
                wrong += [(_stable(system, limit * out), place)]
                away.append((_off_boundary(system, limit, float(one[f"{side}_hz"])), place))
            wrong.append((not _stable(system, 1.0), f"{drive}, {loop}, own gain"))
    # The certified peaks are in continuous time.
    reached = np.array(
        [_reached(axis, gain, values, scale) for scale in SCALES.values()]
    )  # (scale, drive)
    lower, upper = (
        answer["weighted"].sel(bound=bound).values[:, :-1] for bound in ("lower", "upper")
    )
    names = answer["drive"].values
    ratio, where = worst(reached / upper, lambda i: str(names[i[1]]))
    least, which = worst(lower / reached, lambda i: str(names[i[1]]))
    excess, there = worst(upper / reached - 1, lambda i: str(names[i[1]]))
    mistakes = [place for bad, place in wrong if bad]
    distance, pole = max(away, key=lambda entry: np.nan_to_num(entry[0], nan=np.inf))
    return [
        Check(
            "stability",
            f"closed loops on the wrong side, at their own gain and {ASIDE:g} beside their limits",
            len(mistakes),
            0,
            ", ".join(mistakes[:3]),
        ),
        Check(
            "gain limits",
            "distance of a pole from its place on the stability boundary, relative",
            distance,
            ON_BOUNDARY,
            pole,
        ),
        Check("peaks above", "|W_p S| by formulas over its upper bound", ratio, 1 + 1e-9, where),
        Check("peaks reached", "lower bound over |W_p S| by formulas", least, 1 + 1e-6, which),
        Check("peaks close", "upper bound above |W_p S| by formulas", excess, CLOSE, there),
        Check(
            "Red Book",
            "largest |S| over what the Red Book permits, continuous, full gain; W_p being laxer, "
            "not 1 but what W_p permits is the limit",
            numbers["red_book_error_full_continuous"],
            numbers["weight_laxer_than_red_book"],
        ),
    ]


def thesis_checks(answer: Dataset, numbers: dict[str, float]) -> list[Check]:
    """What section 6.3.3 says of the focus loop; where it does not hold, what does instead."""
    twelve = answer.isel(drive=slice(-1))
    names = twelve["drive"].values
    peak, drive = worst(
        twelve["weighted"].sel(scale="full", bound="upper").values, lambda i: str(names[i[0]])
    )
    least = twelve["weighted"].sel(scale="third", bound="lower")
    upward = twelve["increase"] * twelve["decrease"]  # below 1: less room upward
    room, which = worst(upward.values, lambda i: str(names[i[1]]))
    checks = [
        Check("performance", "largest |W_p S| of twelve drives, own gain", peak, 1.0, drive),
        Check(
            "a third fails",
            "inverse of the smallest of twelve peaks of |W_p S|, a third of the gain",
            float(1 / least.min()),
            1.0,
            str(least.idxmin("drive").values),
        ),
        Check(
            "a third fails below 500 Hz",
            "largest frequency at which |W_p S| passes 1 with a third of the gain [Hz]",
            numbers["third_fails_below_hz"],
            FAILS_BELOW,
        ),
        Check("upward", "gain margin up over gain margin down, as factors", room, 1.0, which),
    ]
    for name, said in zip(("lower", "upper"), LIMITS_HZ, strict=True):
        found = numbers[f"{name}_limit_sampled_hz"]
        checks.append(
            Check(
                f"{name} limit",
                f"frequency of the nominal sampled loop's limit, {found:.0f} Hz, from {said:g} Hz",
                abs(found / said - 1),
                ABOUT,
            )
        )
    checks.append(
        Check(
            "bandwidth",
            "delay beyond the hold's at which |T| is -3 dB at 1330 Hz [samples]; "
            f"without it {numbers['bandwidth_T_sampled_hz']:.0f} Hz",
            numbers["delay_of_bandwidth_samples"],
            DELAYS["bandwidth"],
        )
    )
    checks.append(
        Check(
            "Table A.4",
            "delay beyond the hold's at which the mean gain margin is the table's [samples]; "
            f"without it {numbers['above_table_a4_sampled_db']:+.2f} dB",
            numbers["delay_of_table_a4_samples"],
            DELAYS["table_a4"],
        )
    )
    checks.append(
        Check(
            "order of Table A.4",
            "correlation of the drives' margins with the table's, which they do not explain",
            numbers["correlation_with_table_a4"],
            UNRELATED,
        )
    )
    return checks


def _poles(loop: StateSpace, gain: float) -> ComplexArray:
    """Poles of 1 / (1 + gain L)."""
    direct = 1 + gain * loop.D[0, 0]
    poles: ComplexArray = np.linalg.eigvals(loop.A - gain * loop.B @ loop.C / direct).astype(
        complex
    )
    return poles


def _stable(loop: StateSpace, gain: float) -> bool:
    poles = _poles(loop, gain)
    return bool((abs(poles) < 1).all() if loop.dt else (poles.real < 0).all())


def _off_boundary(loop: StateSpace, gain: float, frequency: float) -> float:
    """Distance of the pole nearest to where a limit is said to be, relative."""
    s = 2j * np.pi * frequency
    place, size = (np.exp(s * loop.dt), abs(s) * loop.dt) if loop.dt else (s, abs(s))
    return float(abs(_poles(loop, gain) - place).min() / size)


def _reached(axis: Axis, gain: Gain, values: Values, scale: float) -> list[float]:
    """Largest |W_p S| of each drive by eq. 3.18, 6.11 and 6.12 as they are printed."""
    M, A, bandwidth, integral = WEIGHTS[axis]
    w_B, w_I = 2 * np.pi * bandwidth, 2 * np.pi * integral
    K = controller(axis)
    zeros, poles = K.zeros(), K.poles()
    factor = K.num[0][0][0] / K.den[0][0][0]

    def sizes(frequency: RealArray) -> RealArray:
        s = 2j * np.pi * frequency
        corner = (s / M ** (1 / 3) + w_B) / (s + w_B * A ** (1 / 3))
        weight = corner**3 * (s + w_I) / (s + LEAK)
        law = np.prod(s[:, None] - zeros, axis=1) / np.prod(s[:, None] - poles, axis=1)
        L = scale * factor * law * responses(axis, frequency, gain, values)
        found: RealArray = abs(weight / (1 + L))
        return found

    grid = np.geomspace(1e-5, 1e6, 2000)
    peaks = []
    for row, k in enumerate(sizes(grid).argmax(axis=1)):
        low, high = np.log(grid[max(k - 1, 0)]), np.log(grid[min(k + 1, len(grid) - 1)])

        def level(decades: float, row: int = row) -> float:
            return -float(sizes(np.array([np.exp(decades)]))[row, 0])

        found = minimize_scalar(level, bounds=(low, high), method="bounded")
        peaks.append(-float(found.fun))
    return peaks
