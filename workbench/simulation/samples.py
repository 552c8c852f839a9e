"""What happens in a sample between the calls of controller, sensor and reading.

The compiled loop and the plain one are made of these functions. They are inlined in the compiled
loop, which makes it about twice as fast: a call hands over seven numbers for each array. The sums
are plain: with four side by side in a vector the loop was slower.

The groups of arguments are those that `SampledLoop` makes:
  memory  state x, positions, filters' outputs, their inputs at the start of a step
  desk    converted channels; state at the end of a step; what the sensor is given from
          outside, and what it gives at the middle and the end of a step
  plant   transition, drive, age, fraction, weights (see `SampledLoop._advance`), x -> outputs
  levels  limits and step of every channel's converter, and of every output's
  played  excitation, exogenous signals, noise
  record  command, output, channels, position; counts of saturated samples
"""

from __future__ import annotations

from typing import Any

from workbench._core.arrays import RealArray
from workbench._core.compiled import inlined
from workbench.simulation.converters import convert


@inlined
def measure(
    k: int, memory: Any, desk: Any, plant: Any, levels: Any, played: Any, record: Any
) -> None:
    """Record positions and converted channels of sample k."""
    x, at, filtered, _ = memory
    converted, to_output, limits, noise = desk[0], plant[5], levels[0], played[2]
    _, _, channels, position, _, saturated = record
    n, q, s = len(x), len(at), len(filtered)
    for i in range(q):
        position[k, i] = at[i]
    for i in range(len(converted)):
        raw = noise[k, i]
        if i < s:
            raw += filtered[i]
        else:
            for j in range(n):
                raw += to_output[q + i - s, j] * x[j]
        converted[i], over = convert(raw, limits[i, 0], limits[i, 1], limits[i, 2])
        channels[k, i] = converted[i]
        saturated[i] += over


@inlined
def recall(k: int, measurements: int, output: RealArray, row: RealArray) -> None:
    """Write the outputs of the previous sample into the row, after the measurements."""
    for i in range(output.shape[1]):
        row[measurements + i] = output[k - 1, i] if k > 0 else 0.0


@inlined
def convert_command(k: int, row: RealArray, levels: Any, played: Any, record: Any) -> None:
    """Convert the command at the end of the row."""
    limits, excitation = levels[1], played[0]
    wanted, output, saturated = record[0], record[1], record[4]
    m = wanted.shape[1]
    for i in range(m):
        wanted[k, i] = row[len(row) - m + i] + excitation[k, i]
        output[k, i], over = convert(wanted[k, i], limits[i, 0], limits[i, 1], limits[i, 2])
        saturated[i] += over


@inlined
def half_step(
    k: int,
    w: int,
    end: int,
    x: RealArray,
    plant: Any,
    output: RealArray,
    exogenous: RealArray,
    at: RealArray,
    outside: RealArray,
) -> None:
    """Positions and exogenous signals at the middle (``end`` 0) or the end (1) of step w."""
    _product(w, end * len(at), k, x, plant, output, at)
    fraction = plant[3][2 * w + end]
    for i in range(len(outside)):
        old = exogenous[k, i]
        outside[i] = old + fraction * (exogenous[k + 1, i] - old)


@inlined
def finish_step(
    k: int,
    w: int,
    memory: Any,
    plant: Any,
    output: RealArray,
    middle: RealArray,
    end: RealArray,
    after: RealArray,
) -> None:
    """State and filters at the end of step w, from what the sensor has given."""
    x, at, filtered, start = memory
    weights = plant[4]
    _product(w, 2 * len(at), k, x, plant, output, after)
    for i in range(len(x)):
        x[i] = after[i]
    for i in range(len(filtered)):
        inside = weights[w, 1] * start[i] + weights[w, 2] * middle[i]
        filtered[i] = weights[w, 0] * filtered[i] + inside + weights[w, 3] * end[i]
        start[i] = end[i]


@inlined
def _product(
    w: int, first: int, k: int, x: RealArray, plant: Any, output: RealArray, into: RealArray
) -> None:
    """Rows of step w from ``first`` on, times the state x and the output that is held."""
    transition, drive, held = plant[0], plant[1], k - plant[2][w]
    for i in range(len(into)):
        total = 0.0
        for j in range(len(x)):
            total += transition[w, first + i, j] * x[j]
        if held >= 0:
            for j in range(output.shape[1]):
                total += drive[w, first + i, j] * output[held, j]
        into[i] = total
