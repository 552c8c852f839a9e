"""SLICOT's routine AB13MD as a method; its bound is recomputed from the scalings it returns."""

from __future__ import annotations

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.mu.upper.program import MuUpperBound, proved
from workbench.program import Claim, method
from workbench.solvers import Outcome, slicot_routine, slycot_missing
from workbench.structure import Full


def _unfit(program: MuUpperBound) -> str | None:
    """Why the routine cannot take the structure; None if it can."""
    # The routine accepts a block that is not square, but gives a wrong answer.
    for block in program.structure:
        if block.rows != block.columns:
            return f"its blocks must be square, not {block.rows} by {block.columns}"
        if block.rows > 1 and not isinstance(block, Full):
            return f"it knows no repeated scalars; one is repeated {block.rows} times"
    return slycot_missing()


@method(MuUpperBound, "ab13md", optimal=False, unfit=_unfit, accuracy=ANY_ACCURACY_ALIKE)
def _ab13md(program: MuUpperBound, context: Context) -> Claim:
    """SLICOT AB13MD, one matrix after the other; the bound is recomputed from its D and G."""
    ab13md = slicot_routine("ab13md")

    structure = program.structure
    sizes = np.array([block.rows for block in structure])
    # Complex scalars are full blocks of size 1.
    kinds = np.array([2 if block.pair[0] > 0 else 1 for block in structure])
    matrices = program.M.reshape(-1, structure.columns, structure.rows)
    claimed = np.zeros(len(matrices))
    D, G = np.ones((len(matrices), structure.rows)), np.zeros((len(matrices), structure.rows))
    for i in context.track(range(len(matrices)), "matrices"):
        size = np.ldexp(1.0, np.frexp(np.abs(matrices[i]).max())[1])
        if matrices[i].any():
            claimed[i], d, g, _ = ab13md(matrices[i] / size, sizes, kinds)
            claimed[i] *= size
            D[i], G[i] = d**2, g * size

    def diagonal(values: np.ndarray) -> np.ndarray:
        """Diagonal matrices in the shape of the batch."""
        full = values[..., None] * np.eye(structure.rows)
        return full.reshape(program.M.shape).astype(complex)

    answer = proved(program.M, program.structure, diagonal(D), diagonal(D), diagonal(G))
    with np.errstate(all="ignore"):
        above = np.nanmax(answer.value.ravel() / claimed, initial=1.0) - 1.0
    message = (
        f"reported at most {claimed.max(initial=0.0):.9g}, its scalings prove "
        f"{answer.value.max(initial=0.0):.9g}; at worst {above:.2g} above what it reported"
    )
    return answer, Outcome.SOLVED, message
