"""Names and colours of the strategies in figures and tables."""

from __future__ import annotations

from workbench import figures

COLOURS = {
    "reference": figures.BLACK,
    "A": figures.BLUE,
    "B": figures.ORANGE,
    "C": figures.GREEN,
    "K_prime": figures.PURPLE,
    "tuned": figures.AMBER,
}


def titled(name: str) -> str:
    """A strategy's name in figures and tables."""
    return {"K_prime": "K'"}.get(name, name)
