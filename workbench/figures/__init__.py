"""How figures look: axes, labels, colours and block diagrams, in one style for every room.

Takes: arrays and words.
Gives: figures of Matplotlib, which are returned, never shown or written.
Rests on: Okabe and Ito's colours, which colour-blind readers tell apart.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.figures.diagrams import loop_diagram
    from workbench.figures.panels import (
        AMBER,
        BLACK,
        BLUE,
        CYCLE,
        GREEN,
        ORANGE,
        PURPLE,
        SKY,
        axes,
        axis_label,
        bode_plot,
        label,
        legend_below,
        numbers_in,
        phase,
        with_figure_numbers,
    )
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "AMBER",
    "BLACK",
    "BLUE",
    "CYCLE",
    "GREEN",
    "ORANGE",
    "PURPLE",
    "SKY",
    "axes",
    "axis_label",
    "bode_plot",
    "label",
    "legend_below",
    "loop_diagram",
    "numbers_in",
    "phase",
    "with_figure_numbers",
]
