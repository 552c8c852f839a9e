"""Commands for the first hour: start a study, copy the course, examine the installation."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import click

from workbench.cli.group import main
from workbench.errors import InputError


def share(text: str | None, option: str) -> float | None:
    """A fraction, written as 20% or 0.2; None if none is given."""
    if text is None:
        return None
    number = text.strip()
    try:
        return float(number[:-1]) / 100 if number.endswith("%") else float(number)
    except ValueError:
        raise click.BadParameter(
            f"{text!r} is no share: write 20% or 0.2", param_hint=option
        ) from None


def positive(_: Any, option: click.Parameter, number: float | None) -> float | None:
    """A positive number, or None if none is given; an error names the option, as it was typed."""
    if number is not None:
        from workbench.input_checks import need_positive

        need_positive(number, option.opts[0])
    return number


def not_negative(_: Any, option: click.Parameter, number: float) -> float:
    """A number that is not negative; an error names the option, as it was typed."""
    if not 0.0 <= number < math.inf:
        raise InputError(f"{option.opts[0]} is {number}; it must be a number, 0 or more")
    return number


def for_one_channel(given: dict[str, Any]) -> dict[str, Any]:
    """The options of `init` for plants of one input and one output."""
    single = {name: next(iter(given[name]), None) for name in ("input", "output", "limits")}
    if len(given["limits"]) > 1:
        raise click.UsageError("several --limits are given for one input")
    return given | single


def for_channels(given: dict[str, Any]) -> dict[str, Any]:
    """The options of `init` for plants of several inputs or outputs.

    Raises a UsageError for options that are for one channel only.
    """
    for name in ONE_CHANNEL:
        if given[name] not in (None, (), "free"):
            raise click.UsageError(
                f"--{name.replace('_', '-')} is for plants of one input and one output"
            )
    if not (given["input"] and given["output"]):
        raise click.UsageError("name every column of several inputs and outputs: --input, --output")
    taken = {name: one for name, one in given.items() if name not in ("input", "output")}
    found = {name: one for name, one in taken.items() if name not in ONE_CHANNEL}
    limits = given["limits"] or None
    return found | {"inputs": given["input"], "outputs": given["output"], "limits": limits}


ONE_CHANNEL = (
    "excitation", "assume", "spread", "resonance_shift", "structure", "recovery_time",
    "control_rms", "step",
)  # fmt: skip
"""Options of `init` that plants of several channels do not have."""


@main.command()
@click.argument("words", metavar="FOLDER", nargs=-1, required=True)
@click.option(
    "--data", metavar="FILES", required=True, help="One record of each plant: drive*.csv."
)
@click.option(
    "--input",
    metavar="NAME",
    multiple=True,
    help="Column of the input [found by its name]; of several inputs, each with an option.",
)
@click.option(
    "--output",
    metavar="NAME",
    multiple=True,
    help="Column of the output [found by its name]; of several outputs, each with an option.",
)
@click.option("--time", metavar="NAME", help="Column of the time [the equidistant one].")
@click.option(
    "--sample-rate",
    "record_dt",
    type=float,
    callback=lambda _, option, rate: 1 / rate if positive(_, option, rate) else None,
    metavar="HZ",
    help="Sampling rate, if no column holds the time.",
)
@click.option(
    "--excitation",
    metavar="NAME",
    callback=lambda _, __, text: int(text) if text and text.isdigit() else text,
    help="Column of the signal that drove a closed loop, or its period in samples [none].",
)
@click.option(
    "--assume", metavar="NAME", multiple=True, help="Assumption that you vouch for: 'open loop'."
)
@click.option(
    "--period",
    "dt",
    type=float,
    callback=positive,
    metavar="S",
    help="Sampling time of the controller [that of the records].",
)
@click.option(
    "--delay",
    "delay_samples",
    type=float,
    callback=not_negative,
    default=1.0,
    show_default=True,
    help="Delay of the controller's computer [samples].",
)
@click.option(
    "--spread",
    callback=lambda _, option, text: share(text, option.opts[0]),
    metavar="SHARE",
    help="Deviation of plants from the recorded ones: 20% of the response. One record needs it.",
)
@click.option(
    "--resonance-shift",
    callback=lambda _, option, text: share(text, option.opts[0]),
    metavar="SHARE",
    help="Deviation of the plants' resonance frequencies: 5%.",
)
@click.option(
    "--structure",
    type=click.Choice(["free", "pi", "pid"]),
    default="free",
    show_default=True,
    help="Structure of the controller; free: the fewest states.",
)
@click.option(
    "--bandwidth-hz", type=float, metavar="HZ", help="Bandwidth [the largest that is possible]."
)
@click.option(
    "--limits",
    type=float,
    nargs=2,
    multiple=True,
    metavar="LOW HIGH",
    help="Limits of the input, absolute [those in the records]; of several inputs in their order.",
)
@click.option(
    "--effort", type=float, metavar="W", help="Weight of the input [from the plants' gains]."
)
@click.option(
    "--overshoot",
    callback=lambda _, option, text: share(text, option.opts[0]),
    metavar="SHARE",
    help="Largest overshoot after a step of the set-point: 10%; 0: none.",
)
@click.option(
    "--settling-time",
    type=float,
    metavar="S",
    help="Longest time to settle within 2 % after a set-point step.",
)
@click.option(
    "--recovery-time",
    type=float,
    metavar="S",
    help="Longest time to recover to a tenth after a step at the input.",
)
@click.option(
    "--control-rms", type=float, metavar="U", help="Largest rms of the input due to noise."
)
@click.option(
    "--step",
    type=float,
    metavar="Y",
    help="Step of the set-point that must keep the input within its limits.",
)
def init(words: tuple[str, ...], data: str, **given: Any) -> None:
    """Write a study of measured plants to FOLDER, that runs from the records to the C file."""
    from workbench.certificate import distinct_texts
    from workbench.starter import write_channel_study, write_study

    # A shell puts several files in the place of a pattern without quotes; --data takes the first.
    files = [word for word in words if Path(word).is_file()]
    folders = [Path(word) for word in words if word not in files]
    if len(folders) != 1:
        named = ", ".join(map(repr, map(str, folders))) or "none"
        raise click.UsageError(
            f"one new folder is needed, and {named} is given; the records are told as "
            "--data 'records/*.csv'"
        )
    folder = folders[0]
    records = [data, *files] if files else data
    conflict = ""
    if max(len(given["input"]), len(given["output"])) > 1:
        chosen: Any = write_channel_study(folder, records, **for_channels(given))
    else:
        chosen = write_study(folder, records, **for_one_channel(given))
        conflict = f"; workbench run {folder.name}/demands says which demands exclude each other"
    click.echo(f"read: {chosen.columns}")
    width = max(len(name.removesuffix("_hz")) for name in chosen.reasons)
    for name, reason in chosen.reasons.items():
        value, label = getattr(chosen, name), name.removesuffix("_hz")
        values = value if name == "band_hz" else [value]
        told = " to ".join(one if isinstance(one, str) else f"{one:.4g}" for one in values)
        click.echo(f"{label:<{width}}  {told:<12}  {reason}")
    for note in chosen.notes:
        click.echo(f"! {note}")
    # Assumptions that were tested and are usual are listed in the README only; the one about a
    # closed loop is the most serious.
    first = [one for one in chosen.tested if "open loop" in one or ": tested;" not in one]
    for sentence in first:
        click.echo(f"assumed  {sentence}")
    if others := len(chosen.tested) - len(first):
        click.echo(f"assumed  {others} more, tested: {folder}/README.md")
    peak, _ = distinct_texts(chosen.peak, 1.0, digits=3)
    if not chosen.peak < 1:
        click.secho(
            f"! no controller was found that keeps its weights: at {chosen.bandwidth_hz:g} Hz the "
            f"certified peak of mu is {peak}, and must be below 1. {folder} is written; "
            f"change its numbers there (README.md says how){conflict}",
            fg="red",
        )
        sys.exit(1)
    states = f", with {chosen.states} states and integral action" if chosen.states else ""
    click.echo(f"peak of mu  {peak}, certified: every plant of the cover keeps the weights{states}")
    click.echo(f"\nnext: cd {folder}; workbench run '{folder.name}/*'   (README.md says more)")


@main.command()
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("notebooks"),
    show_default=True,
    help="Where to put them.",
)
def notebooks(folder: Path) -> None:
    """Copy the course, ten Jupyter notebooks, to a folder of yours."""
    from workbench.course import copy_notebooks

    for file in copy_notebooks(folder):
        click.echo(file)
    click.echo(f"\nnext: pip install jupyterlab; jupyter lab {folder}")


@main.command()
@click.option(
    "--to",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("examples"),
    show_default=True,
    help="Where to put them.",
)
def examples(folder: Path) -> None:
    """Copy the examples, three plants from records to C, to a folder of yours."""
    from workbench.course import copy_examples

    for file in copy_examples(folder):
        click.echo(file)
    click.echo(
        f"\nnext: cd {folder / 'two_mass_servo'}; python make_records.py   (README.md says more)"
    )


@main.command()
@click.option("--no-test", is_flag=True, help="Leave out the self-test of some seconds.")
def doctor(no_test: bool) -> None:
    """Versions, solvers, threads, cache, and a self-test whose answers are certified."""
    from workbench.cli.guidance.doctor import examination

    well = True
    for one in examination(test=not no_test):
        sign = "  " if one.well else "! "
        click.echo(f"{sign}{one.topic:<28}{one.found}")
        if one.advice:
            click.echo(f"{'':30}-> {one.advice}")
        well = well and one.well
    sys.exit(0 if well else 1)
