"""Findings about inputs that depend on the outputs."""

from __future__ import annotations

from dataclasses import replace

from workbench.identification.record_tests.finding import Finding

WAY_OUT = (
    "record what drove the loop and give it as excitation= (Responses.from_files, ClosedLoopFit; "
    "--excitation NAME of workbench init), or the samples of its period if it repeats itself "
    "(driven_response), or open the loop; if the loop was open, y is recorded too early: shift it, "
    "or are input and output exchanged?"
)
IF_DELAYED = (
    "if the plant delays by a sample, the loop was closed: give what drove it as excitation= "
    "(Responses.from_files, ClosedLoopFit, driven_response), or say direct=False (StateSpaceFit, "
    "record_report), which refuses the record"
)
OTHER_EXCITATION = "give a signal as excitation that does not depend on the outputs"


def closed_loop(name: str, explained: float, share: float) -> Finding:
    """The finding that the outputs predict an input."""
    return Finding(
        kind="feedback",
        message=f"the outputs tell beforehand what '{name}' does: {explained:.0%} of what its own "
        f"past does not tell, and up to {share:.0%} of its variance",
        where=f"input '{name}'",
        strength=explained,
        measure="share of what the input's own past does not tell that the outputs tell",
        remedy=WAY_OUT,
        forbids=True,
    )


def static(name: str, direct: bool) -> Finding:
    """The finding that an input is an exact function of the outputs at the same sample."""
    if direct:
        message = f"'{name}' is an exact function of the outputs: a static plant, or -1/K"
    else:
        message = f"'{name}' is an exact function of the outputs, which answer a sample later"
    return Finding(
        kind="static" if direct else "feedback",
        message=message,
        where=f"input '{name}'",
        strength=1.0,
        measure="share of the input's variance that the outputs of the same sample tell",
        remedy=IF_DELAYED if direct else WAY_OUT,
        forbids=not direct,
    )


def of_excitation(found: Finding) -> Finding:
    """The same finding for an excitation: a signal made from the outputs is not an excitation."""
    return replace(found, kind="feedback", remedy=OTHER_EXCITATION, forbids=True)
