"""No verdict hangs on the rounding of what is computed from runs."""

from pathlib import Path

import numpy as np
import workbench.plants.cd_drive.claims.problem as ledger
from workbench.plants.cd_drive.claims.assignments import assignments

import workbench as wb

STORED = Path(__file__).parents[4] / "results" / "reference"


def test_numbers_are_farther_from_their_limits_than_rounding_moves_them():
    (folder,) = (STORED / "cd" / "claims").iterdir()
    data = wb.open_run(folder).data
    values = dict(zip(data["entry"].values, data["value"].values, strict=True))
    near = {}
    for number in ledger.numbers():
        if number.quantity.arguments is None:
            continue
        for reading in assignments(number.quantity.variables):
            entry = f"{number.run}: {number.quantity.under(ledger.natural() | reading)}"
            value = float(values.get(entry, np.nan))
            if not np.isfinite(value) or value == round(value):
                continue  # under a reading of another run, or a count
            limits = np.array([number.low, number.high])
            limits = limits[np.isfinite(limits)]
            off = np.abs(value - limits) / np.maximum(np.abs(limits), abs(value))
            if (off <= ledger.COMPUTED).any():
                near[entry] = (value, limits)
    assert near == {}
