"""Description of a run folder as a Process Run Crate, which tools of others can read.

An RO-Crate is a folder with one JSON-LD file that describes the other files. The Process Run Crate
profile (https://w3id.org/ro/wfrun/process/) adds one action: which software made which files from
which inputs, and when. Everything comes from run.json; no person, machine or path is named.
"""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    from rocrate.rocrate import ROCrate

# RO-Crate needs http identifiers. This one names the workbench; it is in a reserved domain, so it
# never resolves.
HOME = "https://workbench.example/"
PYPI = "https://pypi.org/project/"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
LICENSE = "https://creativecommons.org/licenses/by/4.0/"

# The crate cannot describe itself; and the checksums are computed later.
UNLISTED = {"ro-crate-metadata.json", "SHA256SUMS"}

# A run that proves that there is no answer has completed; any other ending is a failure.
COMPLETED = {"solved", "inaccurate", "infeasible", "unbounded"}

# Not the mimetypes module: its answers depend on the machine.
FORMATS = {
    ".csv": "text/csv",
    ".h": "text/x-c",
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
    "controller.h": "The controller as C99",
}


def write_crate(folder: Path, run: Mapping[str, Any], help: str) -> None:
    """Describe the files in `folder` in ro-crate-metadata.json; change nothing else.

    `run` is the content of run.json; `help` is the problem's documentation, whose first paragraph
    describes the crate.
    """
    from rocrate.rocrate import ROCrate  # slow to import, and needed only when a run is written

    crate = ROCrate(version="1.1")
    # The person who ran it is not named, but the profile needs an agent.
    words = "Users and developers of the workbench"
    people = _entity(crate, f"{HOME}#people", "Organization", name=words, url=HOME)
    software = _software(crate, run["versions"])
    inputs, files = _inputs(crate, run), _files(crate, folder)
    action = _action(crate, run, software, inputs, files, people)
    _describe(crate, run, help, files, people, action)
    # crate.write(folder) would also write the files; half of crate.metadata.write's output is
    # spaces.
    text = json.dumps(crate.metadata.generate(), separators=(",", ":"), sort_keys=True)
    (folder / crate.metadata.id).write_text(text + "\n", encoding="utf-8")


def _entity(crate: ROCrate, id: str, type: str, **properties: Any) -> Any:
    """A new entity of the crate."""
    from rocrate.model import ContextEntity

    return crate.add(ContextEntity(crate, id, {"@type": type, **properties}))


def _software(crate: ROCrate, versions: Mapping[str, str]) -> Any:
    """The workbench as a piece of software that requires Python and the solvers."""

    def application(id: str, name: str, version: str, url: str, **properties: Any) -> Any:
        about = {"name": name, "softwareVersion": version, "url": url, **properties}
        return _entity(crate, id, "SoftwareApplication", **about)

    libraries = [
        application(
            f"{PYPI}{quote(name)}/{quote(version)}/", name, version, f"{PYPI}{quote(name)}/"
        )
        for name, version in sorted(versions.items())
        if name not in ("workbench", "python")
    ]
    site, own, version = "https://www.python.org/", versions["workbench"], versions["python"]
    python = application(f"{site}#{quote(version)}", "Python", version, site)
    needed = _unpack([python, *libraries])
    return application(f"{HOME}#{quote(own)}", "workbench", own, HOME, softwareRequirements=needed)


def _inputs(crate: ROCrate, run: Mapping[str, Any]) -> list[Any]:
    """Method, parameters, options and needs of the run, as entities."""
    given = [("method", "method", run["method"])] if run["method"] else []
    for kind, key in (("parameter", "parameters"), ("option", "options"), ("need", "needs")):
        given += [(kind, name, _value(value)) for name, value in run[key].items()]
    return [
        _entity(
            crate,
            f"#{quote(f'{kind}/{name}')}",
            "PropertyValue",
            name=name,
            value=value,
            description=kind,
        )
        for kind, name, value in given
    ]


def _files(crate: ROCrate, folder: Path) -> list[Any]:
    """The files of the folder, sorted by name."""
    paths = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    # Without a source the library has nothing to copy or read.
    return [
        crate.add_file(
            dest_path=name,
            properties={
                "name": name,
                "description": DESCRIPTIONS.get(name, name),
                "encodingFormat": FORMATS.get(Path(name).suffix, "application/octet-stream"),
                "contentSize": str((folder / name).stat().st_size),
            },
        )
        for name in sorted(paths)
        if name not in UNLISTED
    ]


def _action(
    crate: ROCrate,
    run: Mapping[str, Any],
    software: Any,
    inputs: list[Any],
    files: list[Any],
    people: Any,
) -> Any:
    """The action of the crate: the software made the files from the inputs, with this outcome."""
    using = f" by {run['method']}" if run["method"] else ""
    status: dict[str, Any] = {"actionStatus": "http://schema.org/CompletedActionStatus"}
    if run["outcome"] not in COMPLETED:
        # Not the exception's text, which may hold paths; it is in the log.
        status = {
            "actionStatus": "http://schema.org/FailedActionStatus",
            "error": f"The run ended as {run['outcome']!r}; see run.json and log.txt",
        }
    return crate.add_action(
        software,
        "#run",
        object=_unpack(inputs),
        result=_unpack(files),
        properties={
            "name": f"Run {run['key']} of {run['problem']}",
            "description": f"{run['problem']} run{using}; outcome: {run['outcome']}",
            "startTime": _time(run["started"]),
            "endTime": _time(run["finished"]),
            "agent": people,
            **status,
        },
    )


def _describe(
    crate: ROCrate,
    run: Mapping[str, Any],
    help: str,
    files: list[Any],
    people: Any,
    action: Any,
) -> None:
    """Describe the whole crate: title, description, date, license, profile, contents."""
    title = f"{run['problem']}, run {run['key']}"
    license = _entity(
        crate,
        LICENSE,
        "CreativeWork",
        name="Creative Commons Attribution 4.0 International",
        description="Free to share and adapt, provided credit is given",
    )
    profile = _entity(crate, PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")
    about = {
        "name": title,
        "description": " ".join(inspect.cleandoc(help).split("\n\n")[0].split()) or title,
        "datePublished": _time(run["finished"]),
        "license": license,
        "author": people,
        "publisher": people,
        "conformsTo": profile,
        "mentions": action,
        "hasPart": _unpack(files),
    }
    for name, value in about.items():
        crate.root_dataset[name] = value


def _unpack(entities: list[Any]) -> Any:
    """A list, or its only element: RO-Crate 1.1 avoids lists of one."""
    return entities[0] if len(entities) == 1 else entities


def _value(value: Any) -> str | int | float:
    """A value that JSON-LD keeps unchanged; lists, nulls and infinities become JSON text."""
    if isinstance(value, (str, int)) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return json.dumps(value, sort_keys=True)


def _time(stamp: str) -> str:
    """A time in the profile's ISO 8601 form: a numeric offset, and milliseconds or none."""
    return datetime.fromisoformat(stamp).isoformat(timespec="milliseconds")
