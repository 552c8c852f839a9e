"""Quantisation: outputs whose converter steps are too coarse to act like noise.

Source: B. Widrow, I. Kollar, Quantization Noise, 2008, chapter 4: rounding to steps q is like white
noise of variance q^2/12 where the signal moves over many steps.
"""

from __future__ import annotations

import numpy as np

from workbench.identification.record_tests.delay import explained
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import evenly_chosen, resolution
from workbench.identification.record_tests.record import RecordData

COARSE = 0.1
"""Rounding error of a converter, relative to the output's standard deviation, that is too large."""
ROUNDED = 0.5
"""Least unexplained part of an output, relative to the rounding error of a converter."""
FEWEST_CHANGES = 20
"""Fewest changes of the output from which its values are taken for those of a converter."""


def quantisation(record: RecordData) -> TestedAssumption:
    """Test whether converters resolve the outputs."""
    clean = unflagged(record)
    found, told = [], []
    for name, y, made in zip(record.outputs, clean.y.T, explained(record).T, strict=True):
        step, size = resolution(y), float(np.std(evenly_chosen(y)))
        if not step > 0:
            told.append(f"{name!r} shows no steps")
            continue
        share = step / np.sqrt(12) / size
        told.append(f"{name!r} has steps of {step:.4g}, {size / step:.3g} in its deviation")
        # An output with few levels may simply follow an input with few levels.
        rounded = float(np.nanstd(y - made)) > ROUNDED * step / np.sqrt(12)
        if share > COARSE and rounded and np.count_nonzero(np.diff(y)) >= FEWEST_CHANGES:
            found.append(
                Finding(
                    "coarse steps",
                    f"{name!r} moves by {size / step:.2g} steps of its converter only; rounding to "
                    f"them is {share:.0%} of its standard deviation, and is no noise",
                    f"output {name!r}, whole record",
                    float(share),
                    "rounding error over the standard deviation of the output",
                    "excite more, take a finer range, or average faster samples",
                )
            )
    return TestedAssumption(
        "converters resolve the outputs", "; ".join(told), findings=tuple(found)
    )
