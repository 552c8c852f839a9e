"""The fault filter of strategy C: a stand-in, or one that another problem designs."""

from __future__ import annotations

from typing import Any

from workbench import Run, ref
from workbench.errors import InputError
from workbench.systems import restored_system
from workbench.types import StateSpace

from .tactics import stand_in_filter

DESIGNED = {"robust": ("fault-filter", "discrete"), "with margins": ("designed-filter", "designed")}
"""Problem that designs a filter, and the name of the filter in its run."""


def needs_with_filter(axis: str, fault_filter: str = "high-pass") -> dict[str, Any]:
    """References to K', and to the fault filter if it is a designed one."""
    found: dict[str, Any] = {"slower": ref(f"cd/{axis}/lower-bandwidth")}
    if fault_filter in DESIGNED:
        found["designed"] = ref(f"cd/{axis}/{DESIGNED[fault_filter][0]}")
    return found


def chosen_filter(fault_filter: str, designed: Run | None) -> StateSpace:
    """The "high-pass", or a designed filter from the run of its problem."""
    if fault_filter not in DESIGNED:
        return stand_in_filter()
    if designed is None:
        raise InputError(
            f"the fault filter {fault_filter!r} is asked for, and no run of it is given"
        )
    return restored_system(designed.data, DESIGNED[fault_filter][1])
