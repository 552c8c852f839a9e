"""Run folders are Process Run Crates in the eyes of the public validator."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from offline import issues, terms

from workbench.bench.formats.crate import write_crate

# rdflib's own JSON-LD parser uses a class that rdflib deprecates.
rdflib_own = pytest.mark.filterwarnings(
    "ignore:ConjunctiveGraph is deprecated:DeprecationWarning:rdflib"
)

HELP = """Four circles that
    just touch.

    More than anyone asked for.
    """
FILES = [
    "run.json",
    "certificate.json",
    "metrics.json",
    "data.nc",
    "log.txt",
    "figures/step_response.svg",
    "figures/step_response.png",
]
RUN: dict[str, Any] = {
    "problem": "cd/focus/circles",
    "key": "0a1b2c3d",
    "parameters": {"radius": 0.5, "orders": [1, 2], "bound": float("inf"), "exact": True},
    "method": "clarabel",
    "options": {"tol": 1e-8, "warm start": None},
    "outcome": "solved",
    "started": "2026-01-02T03:04:05.123456+01:00",
    "finished": "2026-01-02T02:04:06Z",
    "versions": {"workbench": "0.1.0", "python": "3.11.9", "numpy": "2.1.0", "own": "1.0+local"},
    "needs": {"cd/model": "deadbeef"},
}
BARE = RUN | {
    "parameters": {},
    "method": None,
    "options": {},
    "needs": {},
    "outcome": "failed",
    "versions": {"workbench": "0.1.0", "python": "3.11.9"},
}


def make(folder: Path, run: dict[str, Any], files: list[str]) -> Path:
    for name in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    write_crate(folder, run, HELP)
    return folder


def read(folder: Path) -> dict[str, dict[str, Any]]:
    """The entities of a crate, by identifier."""
    document = json.loads((folder / "ro-crate-metadata.json").read_text())
    return {entity["@id"]: entity for entity in document["@graph"]}


@pytest.mark.cases(0)
@rdflib_own
@pytest.mark.parametrize(
    ("run", "files"),
    [(RUN, FILES), pytest.param(BARE, ["log.txt"], marks=pytest.mark.slow)],
    ids=["full", "bare"],
)
def test_valid(tmp_path: Path, run: dict[str, Any], files: list[str]) -> None:
    assert issues(make(tmp_path / "run", run, files), tmp_path / "cache") == []


def test_content(tmp_path: Path) -> None:
    crate = read(make(tmp_path, RUN, FILES))
    root, action = crate["./"], crate["#run"]
    assert root["description"] == "Four circles that just touch."
    assert [part["@id"] for part in root["hasPart"]] == sorted(FILES)
    assert action["result"] == root["hasPart"]
    assert action["actionStatus"].endswith("/CompletedActionStatus")
    assert "error" not in action
    assert {crate[o["@id"]]["name"]: crate[o["@id"]]["value"] for o in action["object"]} == {
        "method": "clarabel",
        "radius": 0.5,
        "orders": "[1, 2]",
        "bound": "Infinity",
        "exact": True,
        "tol": 1e-8,
        "warm start": "null",
        "cd/model": "deadbeef",
    }


def test_failure(tmp_path: Path) -> None:
    action = read(make(tmp_path, BARE, ["log.txt"]))["#run"]
    assert action["actionStatus"].endswith("/FailedActionStatus")
    assert "failed" in action["error"]


def test_nothing_else_is_touched(tmp_path: Path) -> None:
    make(tmp_path, RUN, [*FILES, "SHA256SUMS"])
    before = {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in tmp_path.rglob("*") if p.is_file()}
    crate = tmp_path / "ro-crate-metadata.json"
    write_crate(tmp_path, RUN, HELP)
    after = {p: (p.stat().st_mtime_ns, p.read_bytes()) for p in tmp_path.rglob("*") if p.is_file()}
    assert before.pop(crate)[1] == after.pop(crate)[1]  # rewritten, to the same bytes
    assert before == after


def test_nothing_private(tmp_path: Path) -> None:
    text = (make(tmp_path, RUN, FILES) / "ro-crate-metadata.json").read_text()
    assert str(tmp_path) not in text
    assert str(Path.home()) not in text
    assert socket.gethostname() not in text


def without_instrument(crate: dict[str, dict[str, Any]]) -> None:
    del crate["#run"]["instrument"]


def without_agent(crate: dict[str, dict[str, Any]]) -> None:
    del crate["#run"]["agent"]


def without_profile(crate: dict[str, dict[str, Any]]) -> None:
    del crate["./"]["conformsTo"]


def without_licence(crate: dict[str, dict[str, Any]]) -> None:
    del crate["./"]["license"]


def unlinked_file(crate: dict[str, dict[str, Any]]) -> None:
    crate["./"]["hasPart"].remove({"@id": "run.json"})


def missing_file(crate: dict[str, dict[str, Any]]) -> None:
    crate["gone.txt"] = {"@id": "gone.txt", "@type": "File"}
    crate["./"]["hasPart"].append({"@id": "gone.txt"})


def unknown_term(crate: dict[str, dict[str, Any]]) -> None:
    crate["#run"]["mood"] = "good"


@rdflib_own
@pytest.mark.parametrize(
    ("mutate", "complaint"),
    [
        (without_instrument, "The Action MUST have an instrument"),
        (without_profile, "The Root Data Entity MUST reference a CreativeWork"),
        (without_licence, "The Root Data Entity MUST have a `license`"),
        (unlinked_file, "profiles/ro-crate/RootDataEntity"),
        (missing_file, "does not include the Data Entity 'gone.txt'"),
        (without_agent, "The Action SHOULD have an agent"),
        (unknown_term, 'the JSON-LD key "mood" is not allowed'),
    ],
)
@pytest.mark.slow
def test_the_validator_can_say_no(
    tmp_path: Path, mutate: Callable[[dict[str, dict[str, Any]]], None], complaint: str
) -> None:
    folder = make(tmp_path / "run", RUN, FILES)
    path = folder / "ro-crate-metadata.json"
    document = json.loads(path.read_text())
    crate = read(folder)
    mutate(crate)
    path.write_text(json.dumps(document | {"@graph": list(crate.values())}))
    found = issues(folder, tmp_path / "cache")
    assert any(complaint in issue for issue in found), found


def test_context_is_the_published_one() -> None:
    """Our excerpt of the 1.1 context agrees with the full one, of a later version, in rocrate."""
    from rocrate.vocabs import RO_CRATE

    assert terms().items() <= RO_CRATE["@context"].items()
