"""Checks of sensitivities and margins: closed-loop poles and formulas instead of responses.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from workbench import Check
from workbench.certificate import worst_value
from workbench.types import ComplexArray, Dataset, RealArray, StateSpace

from ...drive.plants import Gain, controller, responses
from ...drive.tables import Axis, Values
from ..control_problem import LEAK, WEIGHTS
from ..loops import SCALES

LIMIT_OFFSET = 1e-3
"""Relative distance from a gain limit at which the poles must be on the expected side."""
POLE_ROUNDING = 1e-6
"""Largest distance of the critical pole from the stability boundary, relative to its frequency."""
PEAK_EXCESS = 5e-3
"""Largest relative excess of a certified peak over the peak by formulas."""
APPROXIMATE = 0.25
"""Largest accepted distance from frequencies that the thesis gives as approximate, relative."""
FAILS_BELOW = 500.0
"""Frequency [Hz] below which a third of the gain fails, according to the thesis."""
LIMITS_HZ = (100.0, 4000.0)
"""Frequencies [Hz] of oscillation that the thesis gives for the lowered and the raised gain."""
DELAYS = {"table_a4": 1.0, "bandwidth": 2.0}
"""Delay [samples] beyond that of the hold that may explain numbers which the sampled loop alone
does not.
"""
UNRELATED = 0.5
"""Correlation below which the drives' tables do not explain the order in Table A.4."""


def limit_checks(answer: Dataset, every: dict[str, dict[str, StateSpace]]) -> list[Check]:
    """Gain limits by closed-loop poles."""
    wrong, away = [], []
    for loop, systems in every.items():
        for drive, L in systems.items():
            one = answer.sel(loop=loop, drive=drive)
            for side, out in (("decrease", 1 - LIMIT_OFFSET), ("increase", 1 + LIMIT_OFFSET)):
                limit, place = float(one[side]), f"{drive}, {loop}, {side}"
                wrong += [place] * (not _stable(L, limit / out)) + [place] * _stable(L, limit * out)
                away.append((_off_boundary(L, limit, float(one[f"{side}_hz"])), place))
            wrong += [f"{drive}, {loop}, own gain"] * (not _stable(L, 1.0))
    distance, pole = max(away, key=lambda entry: np.nan_to_num(entry[0], nan=np.inf))
    where = ", ".join(wrong[:3])
    beside = f"{LIMIT_OFFSET:g} beside their limits"
    sides = f"number of closed loops on the wrong side, at their own gain and {beside}"
    boundary = "distance of a pole from its place on the stability boundary, relative"
    return [
        Check("stability", sides, len(wrong), 0, where=where),
        Check("gain limits", boundary, distance, POLE_ROUNDING, where=pole),
    ]


def peak_checks(answer: Dataset, axis: Axis, gain: Gain, values: Values) -> list[Check]:
    """Certified peaks, which are in continuous time, by the printed formulas."""
    reached = np.array([_largest_weighted(axis, gain, values, scale) for scale in SCALES.values()])
    lower, upper = (
        answer["weighted"].sel(bound=bound).values[:, :-1] for bound in ("lower", "upper")
    )
    compared = [
        ("peaks above", "|W_p S| by formulas over its upper bound", reached / upper, 1 + 1e-9),
        ("peaks reached", "lower bound over |W_p S| by formulas", lower / reached, 1 + 1e-6),
        ("peaks close", "upper bound above |W_p S| by formulas", upper / reached - 1, PEAK_EXCESS),
    ]
    names = answer["drive"].values
    found = []
    for title, statement, ratio, limit in compared:
        largest, where = worst_value(ratio, lambda i: str(names[i[1]]))
        found.append(Check(title, statement, largest, limit, where=where))
    return found


def red_book_check(numbers: dict[str, float]) -> Check:
    """|S| at full gain in continuous time, against the limit of the Red Book."""
    statement = (
        "largest |S| over what the Red Book permits, continuous, full gain; W_p being laxer, "
        "not 1 but what W_p permits is the limit"
    )
    found, limit = (
        numbers[name] for name in ("red_book_error_full_continuous", "weight_laxer_than_red_book")
    )
    return Check("Red Book", statement, found, limit)


def thesis_checks(answer: Dataset, numbers: dict[str, float]) -> list[Check]:
    """Statements of section 6.3.3 about the focus loop; if one fails, what holds instead."""
    twelve = answer.isel(drive=slice(-1))
    names = twelve["drive"].values
    weighted = twelve["weighted"]
    full = weighted.sel(scale="full", bound="upper").values
    highest, drive = worst_value(full, lambda i: str(names[i[0]]))
    least = weighted.sel(scale="third", bound="lower")
    upward = twelve["increase"] * twelve["decrease"]  # below 1 there is less room upwards
    room, which = worst_value(upward.values, lambda i: str(names[i[1]]))
    checks = [
        Check(
            "performance", "largest |W_p S| of twelve drives, own gain", highest, 1.0, where=drive
        ),
        Check(
            "a third fails",
            "inverse of the smallest of twelve peaks of |W_p S|, a third of the gain",
            float(1 / least.min()),
            1.0,
            where=str(least.idxmin("drive").values),
        ),
        Check(
            "a third fails below 500 Hz",
            "largest frequency at which |W_p S| passes 1 with a third of the gain [Hz]",
            numbers["third_fails_below_hz"],
            FAILS_BELOW,
        ),
        Check("upward", "gain margin up over gain margin down, as factors", room, 1.0, where=which),
    ]
    for name, said in zip(("lower", "upper"), LIMITS_HZ, strict=True):
        found = numbers[f"{name}_limit_sampled_hz"]
        checks.append(
            Check(
                f"{name} limit",
                f"relative distance of the nominal sampled loop's limit, {found:.0f} Hz, from "
                f"{said:g} Hz",
                abs(found / said - 1),
                APPROXIMATE,
            )
        )
    bandwidth = (
        "delay beyond the hold's at which |T| is -3 dB at 1330 Hz [samples]; "
        f"without it {numbers['bandwidth_T_sampled_hz']:.0f} Hz"
    )
    table = (
        "delay beyond the hold's at which the mean gain margin is the table's [samples]; "
        f"without it {numbers['above_table_a4_sampled_db']:+.2f} dB"
    )
    order = "correlation of the drives' margins with the table's, which they do not explain"
    delays = numbers["delay_of_bandwidth_samples"], numbers["delay_of_table_a4_samples"]
    return [
        *checks,
        Check("bandwidth", bandwidth, delays[0], DELAYS["bandwidth"]),
        Check("Table A.4", table, delays[1], DELAYS["table_a4"]),
        Check("order of Table A.4", order, numbers["correlation_with_table_a4"], UNRELATED),
    ]


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
    """Distance of the pole nearest to the stated limit, relative."""
    s = 2j * np.pi * frequency
    place, size = (np.exp(s * loop.dt), abs(s) * loop.dt) if loop.dt else (s, abs(s))
    return float(abs(_poles(loop, gain) - place).min() / size)


def _largest_weighted(axis: Axis, gain: Gain, values: Values, scale: float) -> list[float]:
    """Largest |W_p S| of each drive by eq. 3.18, 6.11 and 6.12 as printed."""
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
