"""Differences between stored certificates and metrics and the recomputed ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workbench.program import Task

SAME_NUMBER = 1e-9
"""Relative difference up to which a recomputed number counts as equal to the stored one."""

DECIDED = 1e-4
"""A recomputed value of a check may differ from the stored one by this fraction of its distance
from the limit. For example, the rounding error of a pole depends on its conditioning.
"""


def certificates_apart(stored: Any, fresh: dict[str, Any]) -> list[str]:
    """Entries in which two certificates, as JSON, differ.

    The value of a check is a remainder of rounding or of a search for a proof, so it differs
    between machines and between searches. It counts as equal if it has moved by no more than its
    limit, which is the check's tolerance, or by 1e-4 of its distance from the limit. The values
    measured by a second opinion are not compared, since it samples in doubles near poles and peaks,
    which round differently; but its checks must hold and have the same statements. Facts in words
    are not compared: their numbers are among the metrics.
    """
    if not isinstance(stored, dict):
        return [f"it holds no certificate but {stored!r:.80}"]
    for each in (stored, fresh):
        each.pop("facts", None)
    checks = stored.get("checks")
    if isinstance(checks, list) and len(checks) == len(fresh["checks"]):
        for was, now in zip(checks, fresh["checks"], strict=True):
            if isinstance(was, dict):
                was.update({key: now[key] for key in _fields_free_to_differ(was, now)})
    # The checked value is near zero, where a relative difference means nothing.
    return _json_differences(stored, fresh, floor=1.0)


def metrics_apart(stored: Any, fresh: dict[str, float], task: Task) -> list[str]:
    """Entries in which two mappings of metrics differ."""
    if not isinstance(stored, Mapping):
        return _json_differences(stored, fresh)
    floors = dict.fromkeys(task.relative_metrics, 1.0)
    return [
        text
        for name in sorted(stored.keys() | fresh.keys())
        for text in _json_differences(
            stored.get(name), fresh.get(name), name, floors.get(name, 0.0)
        )
    ]


def _fields_free_to_differ(was: dict[str, Any], now: dict[str, Any]) -> set[str]:
    """The fields of a check that may differ between the stored and the recomputed one."""
    if now["opinion"]:
        return {"value", "limit", "over"}
    try:
        away = abs(float(was["value"]) - float(now["value"]))
        slack = abs(float(now["value"]) - now["limit"])
    except (KeyError, TypeError, ValueError):  # an edited entry is not a number
        return set()
    return {"value"} if away <= max(abs(now["limit"]), DECIDED * slack) else set()


def _json_differences(stored: Any, fresh: Any, path: str = "", floor: float = 0.0) -> list[str]:
    """Entries in which two JSON values differ.

    Numbers differ if their distance exceeds ``SAME_NUMBER`` times their size, or times the floor.
    """
    if isinstance(stored, Mapping) and isinstance(fresh, Mapping):
        return [
            text
            for key in sorted(stored.keys() | fresh.keys())
            for text in _json_differences(
                stored.get(key), fresh.get(key), f"{path}.{key}".lstrip("."), floor
            )
        ]
    if isinstance(stored, list) and isinstance(fresh, list) and len(stored) == len(fresh):
        return [
            text
            for i, pair in enumerate(zip(stored, fresh, strict=True))
            for text in _json_differences(*pair, f"{path}[{i}]", floor)
        ]
    if isinstance(stored, float | int) and isinstance(fresh, float | int):
        same = abs(stored - fresh) <= SAME_NUMBER * max(floor, abs(fresh))
        return [] if same else [f"{path} says {stored:.12g}, recomputed {fresh:.12g}"]
    if path.endswith("where"):  # the place of the worst value is arbitrary among equal ones
        return []
    return [] if stored == fresh else [f"{path} says {stored!r}, recomputed {fresh!r}"]
