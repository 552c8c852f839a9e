"""What the text of the thesis leaves open about the bench, as one choice for all drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..drive.plants import Gain
from ..drive.tables import Axis, Values
from ..laboratory.experiment import Laboratory
from ..laboratory.printed_noise import Amplitude, Fixed, position_noise


@dataclass(frozen=True)
class BenchReading:
    """Gain of the loops, delay of the computer [samples] and noise, for every drive.

    noise, noise_fixed: reading of the printed amplitude, see `printed_noise`. The default is that
    of `Laboratory`.
    """

    gain: Gain = "own"
    delay: float = 1.0
    noise: Amplitude = "rms"
    noise_fixed: Fixed = "metres"

    def laboratory(
        self,
        axis: Axis,
        drive: str,
        values: Values = "printed",
        *,
        noisy: bool = True,
        refine: int = 1,
    ) -> Laboratory:
        """A drive on the bench; ``noisy``: with noise of diodes and electronics."""
        size = position_noise(axis, drive, self.noise, self.noise_fixed)
        quiet: dict[str, Any] = {} if noisy else {"electronics": 0.0}
        return Laboratory(
            axis,
            drive,
            values,
            gain=self.gain,
            delay=self.delay,
            noise=size if noisy else 0.0,
            refine=refine,
            **quiet,
        )
