"""Controllers of a CD drive by mu synthesis."""

from __future__ import annotations

from workbench import Run, problem
from workbench.synthesis import MuSynthesis

from .design import Cover, Form, cover_of, synthesis_plant, uncertainty
from .drives import Gain
from .sets import TABLES, Frequencies
from .tables import Axis


@problem("cd/{axis}/controller", axis=("focus", "radial"), needs=cover_of, data=TABLES)
def controller(
    axis: Axis,
    covered: Run | None = None,
    form: Form = "parametric",
    cover: Cover = "steps",
    gain: Gain = "own",
    frequencies: Frequencies = 400,
    speed: float = 1.0,
) -> MuSynthesis:
    """The controller with the least certified peak of mixed mu, w_p to both outputs (6.3).

    form: of the uncertainty. cover, gain, frequencies: of its cover. speed: of the disc, factor X
    of eq. 6.11.
    """
    return MuSynthesis(synthesis_plant(axis, uncertainty(axis, covered), speed))
