"""Generate a study folder that runs at once: from the records to the C file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.identification.record_tests.report import as_names
from workbench.input_checks import need_choice
from workbench.starter.columns import record_columns
from workbench.starter.first_choices import BENT, FirstChoices, first_choices
from workbench.starter.first_look import UNDISTORTED, FirstLook, first_look, oddities
from workbench.starter.kept_weights import Structure, kept_weights
from workbench.starter.request import Request, present, with_given
from workbench.starter.rest import refuse_opposite_gains
from workbench.starter.study_files import write_files
from workbench.uncertainty import Responses

ROUNDED = 1e-6
"""Relative difference between a measured frequency and a multiple of the sampling rate that counts
as rounding of the recorded times.
"""


def write_study(
    folder: str | Path,
    data: str | Sequence[str],
    *,
    input: str | None = None,
    output: str | None = None,
    time: str | None = None,
    record_dt: float | None = None,
    excitation: str | int | None = None,
    assume: str | Sequence[str] = (),
    dt: float | None = None,
    delay_samples: float = 1.0,
    spread: float | None = None,
    resonance_shift: float | None = None,
    structure: Structure = "free",
    bandwidth_hz: float | None = None,
    limits: tuple[float, float] | None = None,
    effort: float | None = None,
    overshoot: float | None = None,
    settling_time: float | None = None,
    recovery_time: float | None = None,
    control_rms: float | None = None,
    step: float | None = None,
) -> FirstChoices:
    """Write a study folder: problems, notebook, README, test and the records.

    A first design is tried: its bandwidth is lowered until a controller is certified to meet the
    weights. This can take minutes.

    Parameters
    ----------
    folder
        The new folder; the plant gets the folder's name.
    data
        A pattern of files, such as ``"drive*.csv"``, or a list of files; each holds the record of
        one plant.
    input, output, time
        Names of columns; None: they are found by their names and values.
    record_dt
        Sampling time [s] of records without a time column.
    excitation
        Name of the column with the signal added to the closed loops from outside, such as the
        set-point. If that was not recorded but is periodic, its period in samples.
    assume
        Assumptions about the records that you vouch for although their tests reject them, such as
        "open loop".
    dt
        Sampling time [s] of the controller's computer; None: that of the records.
    delay_samples
        Delay [samples] of the controller's computer.
    spread, resonance_shift
        Deviation of plants from the recorded ones, as in `Responses.from_files`; with a single
        record one of the two is needed.
    structure
        ``"pi"``, ``"pid"``, or ``"free"``: the fewest states that meet the weights.
    bandwidth_hz
        Bandwidth that is asked for [Hz]; None: the largest tried bandwidth that meets the weights.
    limits
        Least and largest value of the input, absolute; None: those in the records.
    effort
        Weight of the input at low frequencies; None: derived from the gain of the plants.
    overshoot, settling_time, recovery_time, control_rms
        As in `Demands`; None: not demanded, except for an overshoot of 10 % if the plants are
        unstable. The noise is estimated from the records.
    step
        A step of the set-point [units of the output] during which the input must stay within its
        limits.

    Returns
    -------
    FirstChoices
        The initial numbers of the design, and the reasons for them. Its ``peak`` is 1 or more if no
        tried bandwidth meets the weights.

    Raises
    ------
    InputError
        The folder exists already; its name cannot name a plant; no records are found, or it is
        unclear which of their columns is which; or as `Responses.from_files` and `first_choices`.
        Nothing is written then.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.starter import write_study
    >>> rng, time = np.random.default_rng(0), np.arange(2000) * 0.01
    >>> u = np.tile(rng.standard_normal(250), 8)
    >>> for k in (1, 2, 3):
    ...     y = control.forced_response(control.tf([8 + k], [1, 9]), time, u).outputs
    ...     columns = np.c_[time, u, y]
    ...     np.savetxt(f"drive{k}.csv", columns, delimiter=",", header="time,u,y", comments="")
    ...
    >>> columns = {"input": "u", "output": "y", "time": "time"}
    >>> choices = write_study("servo", "drive*.csv", **columns, structure="pi", bandwidth_hz=0.5)
    >>> choices.unstable_poles, choices.peak < 1
    (0, True)
    """
    demands = {
        "overshoot": overshoot,
        "settling_time": settling_time,
        "recovery_time": recovery_time,
        "control_rms": control_rms,
    }
    need_choice(structure, Structure, "structure")
    given: dict[str, Any] = {"bandwidth_hz": bandwidth_hz, "effort": effort}
    request = Request.checked(
        folder,
        data,
        demands,
        record_dt=record_dt,
        dt=dt,
        delay_samples=delay_samples,
        limits=limits,
        step=step,
        **given,
    )
    paths = request.paths
    columns = record_columns(paths[0], input, output, time, record_dt, excitation)
    look = first_look(paths, *columns, record_dt)
    if control_rms is not None and not look.noise:
        raise InputError("control_rms is demanded, but the records show no noise: leave it out")
    told = request.words(look.period, look.point, look.limits if limits is None else limits)
    stated = present({"spread": spread, "resonance_shift": resonance_shift})
    responses, notes = usable_responses(paths, columns, look, record_dt, excitation, assume, stated)
    asked = given | {"overshoot": overshoot}
    numbers = _Numbers(responses, told["period"], delay_samples, look.columns, notes, asked)
    chosen = numbers.at_most(bandwidth_hz or np.inf)
    chosen.reasons["band_hz"] += f"; records are used up to {UNDISTORTED:g} of their sampling rate"
    told |= _record_words(paths, columns, look) | {
        "named": present(
            {"excitation": excitation, "assume": as_names(assume) if assume else None}
        ),
        "stated": stated,
        "demands": {**demands, "setpoint_step": step},
        "structure": structure,
        "read": responses.read,
    }
    lower = None if bandwidth_hz else partial(numbers.lower, chosen)
    return write_files(
        request.target,
        paths,
        told,
        chosen,
        lambda design: kept_weights(design, chosen, lower, structure),
    )


@dataclass(frozen=True, eq=False)
class _Numbers:
    """Initial numbers of a design for some responses, with those given that are not None."""

    responses: Responses
    period: float
    delay_samples: float
    columns: str
    notes: tuple[str, ...]
    given: Mapping[str, Any]

    def at_most(self, most: float) -> FirstChoices:
        """Those of a design of at most this bandwidth [Hz]."""
        try:
            found = first_choices(
                self.responses, self.period, delay_samples=self.delay_samples, at_most_hz=most
            )
        except InputError as error:
            raise InputError("; ".join([str(error), *self.notes])) from None
        found = replace(found, columns=self.columns, notes=self.notes, tested=self.responses.tested)
        return with_given(found, self.given)

    def lower(self, chosen: FirstChoices, most: float) -> FirstChoices:
        """Those of a lower bandwidth [Hz], on which only the effort depends."""
        other = self.at_most(most)
        return replace(other, reasons={**chosen.reasons, "effort": other.reasons["effort"]})


def usable_responses(
    paths: list[Path],
    columns: tuple[str, str, str | None],
    look: FirstLook,
    record_dt: float | None,
    excitation: str | int | None,
    assume: str | Sequence[str],
    stated: dict[str, Any],
) -> tuple[Responses, tuple[str, ...]]:
    """Responses of the plants where they can be relied on, and what was noticed in the records."""
    u, y, t = columns
    responses = Responses.from_files(
        paths,
        input=u,
        output=y,
        time=t,
        dt=record_dt,
        excitation=excitation,
        assume=assume,
        hold=True,
        **stated,
    ).within(0.0, (1 + ROUNDED) * UNDISTORTED / look.period)
    refuse_opposite_gains(responses, list(responses.plants))
    notes = tuple(filter(None, [responses.assumption])) + look.notes
    responses = responses.linear_within(BENT)
    notes += oddities(responses, [name.partition(" [")[0] for name in responses.plants])
    notes += tuple(
        f"{name}: {finding}"
        for name, report in responses.reports.items()
        for finding in report.findings
    )
    return responses, notes


def _record_words(
    paths: list[Path], columns: tuple[str, str, str | None], look: FirstLook
) -> dict[str, Any]:
    """What the templates say of the records and their signals."""
    u, y, t = columns
    return {
        "names": [path.name for path in paths],
        "input": u,
        "output": y,
        "time": t,
        "noise": look.noise,
        "tried_step": look.span / 2,
        "unit_of_u": bracketed(look.point.u_unit),
        "unit_of_y": bracketed(look.point.y_unit),
    }


def bracketed(unit: str) -> str:
    return "" if unit in ("", "1") else f" [{unit}]"
