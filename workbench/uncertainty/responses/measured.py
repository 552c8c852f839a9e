"""Sources of `Responses`: files, estimates, and python-control's frequency responses.

Each function returns the arguments of `Responses` by name.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset, FrequencyResponseData
from workbench.errors import InputError, UnknownNameError
from workbench.identification.experiments.alike import read_alike
from workbench.identification.experiments.measured_responses import read_response
from workbench.identification.experiments.quality import checked_record
from workbench.identification.experiments.records import read_record
from workbench.identification.experiments.reports import record_report
from workbench.identification.files.variables import need_path
from workbench.identification.record_tests.nonlinearity import LINEAR
from workbench.identification.record_tests.report import RecordReport
from workbench.identification.responses.driven_parts import pulses
from workbench.identification.responses.of_excitation import (
    DrivenResponse,
    driven_responses,
    unrecorded,
)
from workbench.identification.responses.of_records import FEWEST_SAMPLES, record_responses
from workbench.identification.responses.periodic import ResponseEstimate
from workbench.input_checks import (
    as_list,
    common_time_base,
    need_places,
    need_sampling_time,
    need_time_base,
    need_whole,
)
from workbench.uncertainty.responses.ratios import Ratios
from workbench.uncertainty.responses.spread import spread_about

Channel = str | int | None
"""A channel by name or by number from 0; None if there is only one."""
Arguments = dict[str, Any]
"""Arguments of `Responses` by name."""
STATE_ONE = (
    "give two or more, or state how far others lie from it: spread=0.2 for 20 % of its response, "
    "resonance_shift=0.05 for 5 % of its frequencies (--spread 20%, --resonance-shift 5%)"
)
"""Advice to a user who has only one plant."""
TAKEN_OUT = (
    "dry friction of {size:.3g} units of {input!r}, found at silent lines, is taken out: the "
    "response is that of the plant while it moves"
)
"""Why a plant with dry friction counts as linear."""
SAME_RATE = 1e-4
"""Relative difference of sampling frequencies that counts as rounding of the instants."""
SAME_FREQUENCY = 1e-9
"""Relative difference of frequencies that counts as rounding."""


@dataclass(frozen=True)
class RecordNames:
    """Names of the columns of records, and the user's statements about them.

    See `Responses.from_files`.
    """

    input: str | None
    output: str | None
    time: str | None
    dt: float | None
    excitation: str | int | None
    assume: str | Sequence[str]

    @property
    def asked(self) -> bool:
        """Whether both input and output are named."""
        return self.input is not None and self.output is not None

    @property
    def nothing(self) -> bool:
        """Whether nothing is named, as for a frequency response."""
        named = self.input, self.output, self.time, self.dt, self.excitation
        return all(each is None for each in named) and not self.assume


def from_frd(
    systems: Sequence[FrequencyResponseData],
    input: Channel,
    output: Channel,
    names: Mapping[str, Any],
) -> Arguments:
    """Arguments for `Responses.from_frd`."""
    if hasattr(systems, "frdata"):
        raise InputError("one plant has no spread to cover: give a list of two or more")
    systems = as_list(systems, "systems")
    for k, system in enumerate(systems):
        if not hasattr(system, "frdata"):
            kind = type(system).__name__
            raise InputError(f"plant {k + 1} is no frequency response, but a {kind}")
    grids = [np.asarray(system.omega, dtype=float) for system in systems]
    omega = np.unique(np.concatenate(grids)) if grids else np.zeros(0)
    values = np.full((omega.size, len(grids)), np.nan, dtype=complex)
    present = np.zeros(values.shape, bool)
    for k, (grid, system) in enumerate(zip(grids, systems, strict=True)):
        row = _channel(output, system.output_labels, f"plant {k + 1}", "output")
        column = _channel(input, system.input_labels, f"plant {k + 1}", "input")
        at = np.searchsorted(omega, grid)
        values[at, k] = np.asarray(system.frdata)[row, column]
        present[at, k] = True
    given = names.get("dt")
    need_time_base(given)
    # python-control's data without a sampling time have 0, which a dt that is given replaces
    stated = [system.dt or given for system in systems]
    dt = common_time_base([given, *stated])
    need_sampling_time(dt, "each plant")
    return _on_one_grid(omega, values, present, {**names, "dt": dt or 0.0})


def _channel(chosen: Channel, labels: Sequence[str], plant: str, kind: str) -> int:
    """Index of the chosen channel of a plant."""
    if chosen is None:
        if len(labels) > 1:
            raise InputError(
                f"{plant} has {len(labels)} {kind}s, {', '.join(labels)}: choose one, {kind}=..."
            )
        return 0
    if isinstance(chosen, str):
        if chosen not in labels:
            raise UnknownNameError(kind, chosen, list(labels))
        return list(labels).index(chosen)
    if not isinstance(chosen, int) or not 0 <= chosen < len(labels):
        raise InputError(f"there is no {kind} {chosen}; {plant} has {len(labels)}, from 0")
    return chosen


def _on_one_grid(
    omega: np.ndarray, values: np.ndarray, present: np.ndarray, names: Mapping[str, Any]
) -> Arguments:
    """Responses on the union of grids; raises InputError if a frequency has only one plant."""
    lonely = present.sum(axis=1) < 2
    if lonely.any() and values.shape[1] > 1:
        raise InputError(
            f"the plants were measured on different grids: {lonely.sum()} of {omega.size} "
            "frequencies have one plant only, the first at "
            f"{omega[lonely][0] / (2 * np.pi):.6g} Hz; "
            "measure on common frequencies, or interpolate before"
        )
    return {"omega": omega, "values": values, "present": present} | dict(names)


def from_estimates(
    estimates: Sequence[ResponseEstimate],
    input: int,
    output: int,
    spread: float | None,
    resonance_shift: float | None,
    names: Mapping[str, Any],
) -> Arguments:
    """Arguments for `Responses.from_estimates`."""
    estimates = [estimates] if isinstance(estimates, ResponseEstimate) else estimates
    estimates = as_list(estimates, "estimates")
    if len(estimates) < 2 and spread is None and resonance_shift is None:
        raise InputError(f"one plant has no spread to cover: {STATE_ONE}")
    return spread_about(_stacked(estimates, input, output, names), spread, resonance_shift)


def _stacked(
    estimates: Sequence[ResponseEstimate], input: int, output: int, names: Mapping[str, Any]
) -> Arguments:
    """One channel of several estimates, which must have the same frequencies."""
    need_places(input=input, output=output)
    for k, one in enumerate(estimates):
        if not isinstance(one, ResponseEstimate):
            raise InputError(
                f"plant {k + 1} is no estimate of a response, but a {type(one).__name__}"
            )
        for kind, number, count in zip(
            ("output", "input"), (output, input), one.response.shape[1:], strict=True
        ):
            if not 0 <= number < count:
                raise InputError(f"there is no {kind} {number}; plant {k + 1} has {count}, from 0")
    if not estimates:
        raise InputError("no estimates are given: one or more are needed")
    frequency = estimates[0].frequency_hz
    for k, one in enumerate(estimates):
        same = one.frequency_hz.shape == frequency.shape
        if not same or np.abs(one.frequency_hz / frequency - 1).max() > SAME_FREQUENCY:
            raise InputError(
                f"plant {k + 1} was estimated at other frequencies than plant 1; estimate all at "
                "the same"
            )
    called = names.get("plants") or map(str, range(1, len(estimates) + 1))
    reports = {
        name: one.report
        for name, one in zip(called, estimates, strict=False)
        if one.report is not None
    }
    return {
        "reports": reports,
        "values": np.stack([one.response[:, output, input] for one in estimates], axis=1),
        "frequency_hz": frequency,
        "variance": np.stack([one.variance[:, output, input] for one in estimates], axis=1),
        "degrees": [one.degrees for one in estimates],
        "ratios": _ratios(estimates, output),
    } | dict(names)


def _ratios(estimates: Sequence[ResponseEstimate], output: int) -> Ratios | None:
    """Joint covariances, if every estimate is from a closed loop; None if none is."""
    driven = [one for one in estimates if isinstance(one, DrivenResponse)]
    if not driven:
        return None
    if len(driven) < len(estimates):
        raise InputError(
            f"{len(driven)} of {len(estimates)} estimates are of driven loops; estimate all alike"
        )
    joint = np.stack([one.joint[:, output] for one in driven], axis=1)
    return Ratios(joint, np.array([one.chosen for one in driven]))


def from_files(
    files: str | PathLike[str] | Sequence[str | PathLike[str]],
    record: RecordNames,
    frequency: str | None,
    response: str | tuple[str, str] | None,
    most: int,
    hold: bool,
    spread: float | None,
    resonance_shift: float | None,
    names: Mapping[str, Any],
) -> Arguments:
    """Arguments for `Responses.from_files`."""
    paths = found_files(files)
    named = {"plants": _plant_names(paths)} | dict(names)
    curve = (frequency, response)
    if record.asked and curve == (None, None):
        if len(paths) < 2 and spread is None and resonance_shift is None:
            raise InputError(
                f"{paths[0]} is the only file: one plant has no spread to cover; {STATE_ONE}"
            )
        read = _of_records(paths, record, most, hold, named)
        return spread_about(read, spread, resonance_shift)
    if spread is not None or resonance_shift is not None:
        raise InputError("a spread is stated about plants of records: name input= and output=")
    if hold:
        raise InputError("hold belongs to records: name input=, output= and time=, or leave it out")
    if None not in curve and record.nothing:
        return _of_curves(paths, frequency, response, named)
    raise InputError(
        "of a record name input=, output= and time= (or give dt=); of a frequency "
        "response name frequency= and response="
    )


def found_files(files: str | PathLike[str] | Sequence[str | PathLike[str]]) -> list[Path]:
    """Paths in the order of their names; raises InputError if there are none."""
    if not isinstance(files, str | PathLike):
        listed = [need_path(file) for file in as_list(files, "files")]
        if not listed:
            raise InputError("the list of files is empty: name one or more, or give a pattern")
        return listed
    if not str(files):
        raise InputError(
            "the name of the files is empty; name a file, or a pattern such as 'a*.csv'"
        )
    pattern = Path(files)
    root = Path(pattern.anchor)
    paths = sorted(root.glob(str(pattern.relative_to(root))), key=_natural)
    if not paths:
        folder = Path(files).parent
        there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else None
        what = (
            f"it holds {', '.join(there[:8]) or 'nothing'}" if there is not None else "is missing"
        )
        raise InputError(f"no file fits {str(files)!r}; the folder {str(folder)!r}: {what}")
    return paths


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key for names in which 2 comes before 10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _plant_names(paths: Sequence[Path]) -> list[str]:
    """Names of files without endings; with their folders if two are equal."""
    stems = [path.stem for path in paths]
    if len(set(stems)) == len(stems):
        return stems
    return [str(path) for path in paths]


def _of_records(
    paths: Sequence[Path], record: RecordNames, most: int, hold: bool, names: Mapping[str, Any]
) -> Arguments:
    """Responses estimated from a record in each file."""
    need_whole(most, "most")
    if most < 2:
        raise InputError(f"most is {most}; two frequencies or more are needed")
    input, output = str(record.input), str(record.output)
    read, alike = read_alike(paths, input, output, record.dt, record.time)
    rates = [
        1.0 / float(np.diff(data["time"].values[[0, -1]])[0] / (data.sizes["time"] - 1))
        for data in read
    ]
    for path, rate in zip(paths, rates, strict=True):
        if abs(rate / rates[0] - 1) > SAME_RATE:
            raise InputError(
                f"{path} is sampled at {rate:.6g} Hz and {paths[0]} at {rates[0]:.6g} Hz; sample "
                "all at the same rate"
            )
    records = [(data["u"].values[0], data["y"].values[0]) for data in read]
    for path, (u, y) in zip(paths, records, strict=True):
        if len(u) < FEWEST_SAMPLES:
            raise InputError(
                f"{path} has {len(u)} samples; {FEWEST_SAMPLES} are needed at least: take a longer "
                "record"
            )
        for kind, name, values in (("input", input, u), ("output", output, y)):
            if np.ptp(values) == 0:
                raise InputError(
                    f"{path}: the {kind} {name!r} never changes, it is {values[0]:g} in all "
                    f"{len(values)} samples: check its cable and range, or name another column"
                )
        try:
            checked_record(u[:, None], y[:, None])
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    rate = 1 / record.dt if record.dt else float(np.mean(rates))
    driven = _excitations(paths, record, records) if record.excitation is not None else None
    reports = _reports(paths, read, driven, rate, record)
    estimates: Sequence[ResponseEstimate]
    if driven is None:
        estimates, said = record_responses(records, rate, most)
        reports = [
            report.with_reasons({LINEAR: TAKEN_OUT.format(size=one.dry_friction, input=input)})
            if one.dry_friction
            else report
            for report, one in zip(reports, estimates, strict=True)
        ]
    else:
        each = zip(records, driven, strict=True)
        triples = [
            (u[:, None], y[:, None], record.excitation if isinstance(record.excitation, int) else r)
            for (u, y), r in each
        ]
        try:
            estimates, said = driven_responses(triples, rate, most)
        except InputError as error:
            raise InputError(f"excitation {record.excitation!r}: {error}") from None
    unit = _ratio(*(str(read[0][name].attrs["units"]) for name in ("y", "u")))
    told: Arguments = {"unit": unit, "read": "; ".join([read[0].attrs["read"], *alike, said])}
    told["reports"] = dict(zip(names["plants"], reports, strict=False))
    if not hold:
        return _stacked(estimates, 0, 0, told | dict(names))
    told["read"] += "; the hold of the input is taken out"
    return _unheld(_stacked(estimates, 0, 0, told | dict(names)), rate)


def _excitations(
    paths: Sequence[Path], record: RecordNames, records: Sequence[tuple[np.ndarray, np.ndarray]]
) -> list[np.ndarray]:
    """The external excitation of each loop (N, 1); its unit does not matter."""
    if isinstance(record.excitation, int):
        return [pulses(len(u), record.excitation)[..., 0] for u, _ in records]
    name, output = [str(record.excitation)], [str(record.output)]
    read = [read_record(path, name, output, dt=record.dt, time=record.time) for path in paths]
    return [data["u"].values.T for data in read]


def _reports(
    paths: Sequence[Path],
    read: Sequence[Dataset],
    driven: Sequence[np.ndarray] | None,
    rate: float,
    record: RecordNames,
) -> list[RecordReport]:
    """The report of each record; raises InputError for one that must not be used."""
    found = []
    for k, (path, data) in enumerate(zip(paths, read, strict=True)):
        r = None if driven is None else driven[k]
        try:
            report = record_report(data, None, r=r, dt=1.0 / rate).assuming(record.assume)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        if isinstance(record.excitation, int):
            report = unrecorded(report, record.excitation)
        report.need_usable(str(path))
        found.append(report)
    return found


def _unheld(found: Arguments, rate: float) -> Arguments:
    """Responses and variances divided by the hold (1 - exp(-j omega T)) / (j omega T) of the
    input.
    """
    turn = np.asarray(found["frequency_hz"]) / rate
    held = (np.sinc(turn) * np.exp(-1j * np.pi * turn))[:, None]
    parts = {"values": found["values"] / held, "variance": found["variance"] / np.abs(held) ** 2}
    if (ratios := found.get("ratios")) is not None:
        parts["ratios"] = ratios.scaled(1 / held[:, 0])
    return found | parts


def _ratio(above: str, below: str) -> str:
    """Unit of a ratio of two units."""
    if above == below:
        return "1"
    parts = [f"({unit})" if "/" in unit else unit for unit in (above, below)]
    return above if below == "1" else "/".join(parts)


def _of_curves(
    paths: Sequence[Path],
    frequency: str | None,
    response: str | tuple[str, str] | None,
    names: Mapping[str, Any],
) -> Arguments:
    """Responses of SISO plants read from files, on the union of their frequencies."""
    read = [read_response(path, str(frequency), response or "") for path in paths]
    for path, data in zip(paths, read, strict=True):
        if data["response"].shape[1:] != (1, 1):
            sizes = " x ".join(map(str, data["response"].shape[1:]))
            raise InputError(f"{path} holds a response of {sizes} channels; one is needed")
    grids = [2 * np.pi * data["frequency"].values for data in read]
    omega = np.unique(np.concatenate(grids))
    values = np.full((omega.size, len(grids)), np.nan, dtype=complex)
    present = np.zeros(values.shape, bool)
    for k, (grid, data) in enumerate(zip(grids, read, strict=True)):
        at = np.searchsorted(omega, grid)
        if np.unique(at).size < at.size:
            twice = grid[np.argmax(np.bincount(at)[at] > 1)] / (2 * np.pi)
            raise InputError(
                f"{paths[k]} has the frequency {twice:.6g} Hz twice: leave one of its rows out"
            )
        values[at, k], present[at, k] = data["response"].values[:, 0, 0], True
    return _on_one_grid(omega, values, present, {"read": read[0].attrs["read"]} | dict(names))
