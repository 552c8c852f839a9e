"""A sampled record of a system with one input and one output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import as_record, require_alive
from workbench.identification.experiments.reports import report_of_arrays
from workbench.identification.transfer_functions.filters import Hold
from workbench.input_checks import need_positive


@dataclass(frozen=True, eq=False)
class SampledRecord:
    """A record of a system with one input and one output, which starts at rest.

    Parameters
    ----------
    u, y
        Input and output, shape (N,).
    dt
        Sampling time [s].
    hold
        How the input moves between its samples; the output is always interpolated linearly. If both
        pass anti-aliasing filters, "first-order" suits both.
    noise_free_input
        Input (N,) without the noise that feedback adds to it, used for the instruments; for
        instance the part of u that an excitation of the loop explains. None: u itself, which is
        right in open loop.
    assume
        Assumptions about the record that you vouch for although its `record_report` rejects them.

    Raises
    ------
    InputError
        Records of different lengths, values that are not finite, a channel that never changes, or a
        finding that forbids the use of the record.

    Examples
    --------
    >>> from workbench.identification import SampledRecord
    >>> record = SampledRecord([0.0, 1.0, 1.0], [0.0, 0.0, 0.5], dt=1 / 100.0)
    >>> record.hold
    'zero-order'
    """

    u: RealArray
    y: RealArray
    dt: float
    _: KW_ONLY
    hold: Hold = "zero-order"
    noise_free_input: RealArray | None = None
    assume: str | Sequence[str] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        need_positive(self.dt, "dt")
        if self.hold not in ("zero-order", "first-order"):
            raise InputError(f'hold is {self.hold!r}; it must be "zero-order" or "first-order"')
        given = {"u": self.u, "y": self.y, "noise_free_input": self.noise_free_input}
        for name, values in given.items():
            if values is not None:
                signal = as_record(values, name=name)
                if signal.shape != (len(self.y),):
                    raise InputError(f"{name} has shape {signal.shape}; as many samples as y has")
                require_alive(signal, name)
                object.__setattr__(self, name, signal)
        report_of_arrays(
            self.u[:, None],
            self.y[:, None],
            self.assume,
            self.dt,
            r=None if self.noise_free_input is None else self.noise_free_input[:, None],
        )

    @property
    def clean_input(self) -> RealArray:
        """The input without noise if it is known, otherwise the measured one."""
        return self.u if self.noise_free_input is None else self.noise_free_input
