"""A run folder described as a Process Run Crate, so that strangers' tools can read it.

An RO-Crate is a folder with one JSON-LD file that says what the other files are. The Process Run
Crate profile (https://w3id.org/ro/wfrun/process/) adds one action: which software made which files
from which inputs, and when. Only what run.json already holds goes in: no person, machine or path.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

# RO-Crate wants http identifiers; this one names the workbench and, being reserved, never resolves.
HOME = "https://workbench.example/"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
LICENSE = "https://creativecommons.org/licenses/by/4.0/"

# The crate cannot describe itself, and the checksums are taken after it.
UNLISTED = {"ro-crate-metadata.json", "SHA256SUMS"}

# A run that proves there is no answer has done its work; every other ending is a failure.
COMPLETED = {"solved", "inaccurate", "infeasible", "unbounded"}

# Not the mimetypes module: its answers depend on the machine.
FORMATS = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".nc": "application/x-netcdf",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".txt": "text/plain",
}
DESCRIPTIONS = {
    "run.json": "What was run: problem, parameters, method, options, versions, times and outcome",
    "certificate.json": "Independent checks of the answer, with the numbers behind each verdict",
    "metrics.json": "Figures of merit of the answer",
    "data.nc": "Labelled arrays of the answer (NetCDF 4)",
    "log.txt": "What the run printed",
}


def write_crate(folder: Path, run: Mapping[str, Any], help: str) -> None:
    """Describe the files in `folder` in ro-crate-metadata.json, and touch nothing else.

    `run` is the content of run.json; `help` is the problem's documentation, whose first paragraph
    describes the crate.
    """
    from rocrate.model import ContextEntity  # slow to import, and only written runs need it
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version="1.1")

    def add(id: str, type: str, **properties: Any) -> ContextEntity:
        return crate.add(ContextEntity(crate, id, {"@type": type, **properties}))

    title = f"{run['problem']}, run {run['key']}"
    description = " ".join(inspect.cleandoc(help).split("\n\n")[0].split()) or title

    # Whoever ran it is not named, yet the profile asks for an agent.
    everyone = add(
        f"{HOME}#people", "Organization", name="Users and developers of the workbench", url=HOME
    )
    license = add(
        LICENSE,
        "CreativeWork",
        name="Creative Commons Attribution 4.0 International",
        description="Free to share and adapt, provided credit is given",
    )
    profile = add(PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")

    libraries = [
        add(
            f"https://pypi.org/project/{quote(name)}/{quote(version)}/",
            "SoftwareApplication",
            name=name,
            softwareVersion=version,
            url=f"https://pypi.org/project/{quote(name)}/",
        )
        for name, version in sorted(run["versions"].items())
        if name not in ("workbench", "python")
    ]
    python = add(
        f"https://www.python.org/#{quote(run['versions']['python'])}",
        "SoftwareApplication",
        name="Python",
        softwareVersion=run["versions"]["python"],
        url="https://www.python.org/",
    )
    workbench = add(
        f"{HOME}#{quote(run['versions']['workbench'])}",
        "SoftwareApplication",
        name="workbench",
        softwareVersion=run["versions"]["workbench"],
        url=HOME,
        softwareRequirements=_unpack([python, *libraries]),
    )

    inputs = [
        add(
            f"#{quote(f'{kind}/{name}')}", "PropertyValue", name=name, value=value, description=kind
        )
        for kind, name, value in _inputs(run)
    ]
    # Without a source there is nothing that the library could copy or read.
    files = [
        crate.add_file(
            dest_path=name,
            properties={
                "name": name,
                "description": _describe(name),
                "encodingFormat": FORMATS.get(Path(name).suffix, "application/octet-stream"),
                "contentSize": str((folder / name).stat().st_size),
            },
        )
        for name in _files(folder)
    ]

    using = f" by {run['method']}" if run["method"] else ""
    status: dict[str, Any] = {"actionStatus": "http://schema.org/CompletedActionStatus"}
    if run["outcome"] not in COMPLETED:
        # Not the exception's own words, which may hold paths; the log has them.
        status = {
            "actionStatus": "http://schema.org/FailedActionStatus",
            "error": f"The run ended as {run['outcome']!r}; see run.json and log.txt",
        }
    action = crate.add_action(
        workbench,
        "#run",
        object=_unpack(inputs),
        result=_unpack(files),
        properties={
            "name": f"Run {run['key']} of {run['problem']}",
            "description": f"{run['problem']} run{using}; outcome: {run['outcome']}",
            "startTime": _time(run["started"]),
            "endTime": _time(run["finished"]),
            "agent": everyone,
            **status,
        },
    )

    root = crate.root_dataset
    root["name"] = title
    root["description"] = description
    root["datePublished"] = _time(run["finished"])
    root["license"] = license
    root["author"] = everyone
    root["publisher"] = everyone
    root["conformsTo"] = profile
    root["mentions"] = action
    root["hasPart"] = _unpack(files)

    # crate.write(folder) would also write the files, crate.metadata.write spends half on blanks.
    text = json.dumps(crate.metadata.generate(), separators=(",", ":"), sort_keys=True)
    (folder / crate.metadata.id).write_text(text + "\n", encoding="utf-8")


def _unpack(entities: list[Any]) -> Any:
    """A list, or its only element: RO-Crate 1.1 asks for no lists of one."""
    return entities[0] if len(entities) == 1 else entities


def _files(folder: Path) -> list[str]:
    """What the crate describes, as sorted relative paths."""
    names = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    return sorted(name for name in names if name not in UNLISTED)


def _describe(name: str) -> str:
    """What a file of a run folder holds, in one line."""
    return DESCRIPTIONS.get(name, name)


def _inputs(run: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    """Everything that went into the run, as (kind, name, value)."""
    if run["method"]:
        yield "method", "method", run["method"]
    for kind, key in (("parameter", "parameters"), ("option", "options"), ("need", "needs")):
        for name, value in run[key].items():
            yield kind, name, _value(value)


def _value(value: Any) -> str | int | float:
    """A value that JSON-LD keeps as it is; lists, nulls and infinities become JSON text."""
    if isinstance(value, (str, int)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return json.dumps(value, sort_keys=True)


def _time(stamp: str) -> str:
    """The profile's ISO 8601: a numeric offset, and milliseconds or none."""
    return datetime.fromisoformat(stamp).isoformat(timespec="milliseconds")
