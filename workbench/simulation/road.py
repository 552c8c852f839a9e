"""The fast road of simulations: one compiled loop for all controllers."""

from __future__ import annotations

from typing import Any

from workbench._core.machine_code.door import Road


def _compiled() -> Any:
    from workbench.simulation import machine
    from workbench.simulation.known_answer import check_compiled_loop

    check_compiled_loop()
    return machine


SIMULATION = Road("simulations", _compiled)
"""The module with `fast_loop` and `fast_play`."""
