"""Where stored certificates and metrics differ from those that are recomputed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from workbench.program import Task

SAME_NUMBER = 1e-9
"""Relative difference at which recomputed numbers count as the stored ones."""

DECIDED = 1e-4
"""Part of the distance between the value of a check and its limit within which a recomputed value
counts as the stored one. A pole is an example: it rounds as badly as it is conditioned."""


def certificates_apart(stored: Any, fresh: dict[str, Any]) -> list[str]:
    """Places where two certificates as JSON differ.

    The value of a check is what rounding and a search for a proof leave over. It differs between
    machines and between searches. It counts as the same where it has moved by no more than its
    limit, which is the tolerance of the check, or by 1e-4 of its distance from it. What a second
    opinion measured is not compared, for it samples in plain doubles about poles and peaks that
    round differently; that its checks hold, and what they say, is. Facts in words are not compared:
    their numbers are among the metrics.
    """
    if not isinstance(stored, dict):
        return [f"it holds no certificate but {stored!r:.80}"]
    for each in (stored, fresh):
        each.pop("facts", None)
    checks = stored.get("checks")
    if isinstance(checks, list) and len(checks) == len(fresh["checks"]):
        for was, now in zip(checks, fresh["checks"], strict=True):
            if isinstance(was, dict):
                was.update({key: now[key] for key in _free(was, now)})
    # What is checked is near zero, where a relative difference says nothing.
    return _apart(stored, fresh, floor=1.0)


def metrics_apart(stored: Any, fresh: dict[str, float], task: Task) -> list[str]:
    """Places where two mappings of metrics differ."""
    if not isinstance(stored, Mapping):
        return _apart(stored, fresh)
    floors = dict.fromkeys(task.relative_metrics, 1.0)
    return [
        text
        for name in sorted(stored.keys() | fresh.keys())
        for text in _apart(stored.get(name), fresh.get(name), name, floors.get(name, 0.0))
    ]


def _free(was: dict[str, Any], now: dict[str, Any]) -> set[str]:
    """What a stored check may say otherwise than the recomputed one."""
    if now["opinion"]:
        return {"value", "limit", "over"}
    try:
        away = abs(float(was["value"]) - float(now["value"]))
        slack = abs(float(now["value"]) - now["limit"])
    except (KeyError, TypeError, ValueError):  # what was edited is no number
        return set()
    return {"value"} if away <= max(abs(now["limit"]), DECIDED * slack) else set()


def _apart(stored: Any, fresh: Any, path: str = "", floor: float = 0.0) -> list[str]:
    """Places where two JSON values differ.

    Numbers differ when they are further apart than ``SAME_NUMBER`` of them or of the floor.
    """
    if isinstance(stored, Mapping) and isinstance(fresh, Mapping):
        return [
            text
            for key in sorted(stored.keys() | fresh.keys())
            for text in _apart(stored.get(key), fresh.get(key), f"{path}.{key}".lstrip("."), floor)
        ]
    if isinstance(stored, list) and isinstance(fresh, list) and len(stored) == len(fresh):
        return [
            text
            for i, pair in enumerate(zip(stored, fresh, strict=True))
            for text in _apart(*pair, f"{path}[{i}]", floor)
        ]
    if isinstance(stored, float | int) and isinstance(fresh, float | int):
        same = abs(stored - fresh) <= SAME_NUMBER * max(floor, abs(fresh))
        return [] if same else [f"{path} says {stored:.12g}, recomputed {fresh:.12g}"]
    if path.endswith("where"):  # the place of the worst of equal values is arbitrary
        return []
    return [] if stored == fresh else [f"{path} says {stored!r}, recomputed {fresh!r}"]
