"""Run parts of `make test-processors` that are not done yet, and print what holds where.

What a part gave is kept in `.processors/EMULATION/KEY/`, where the key is a hash of every file of
the checkout and of what the emulation runs on; so what was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import fnmatch
import hashlib
import json
import re
import shutil
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

from emulations import EMULATIONS, ROOT, Emulation, environment, plain_environment
from parts import PARTS, Part

KEPT = ROOT / ".processors"
PROOF = Path(__file__).with_name("proof.py")
FAILED = re.compile(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", re.MULTILINE)
"""Names of tests in pytest's summary."""


@cache
def files_key() -> str:
    """Hash of the names and contents of all files that git keeps or would keep."""
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found = hashlib.sha256()
    for name in sorted(name for name in names.split("\0") if (ROOT / name).is_file()):
        found.update(name.encode() + b"\0" + (ROOT / name).read_bytes() + b"\0")
    return found.hexdigest()


@cache
def native(venv: str) -> dict[str, Any]:
    """What this processor is by itself; first the versions are installed where they are not."""
    subprocess.run(["make", f"{venv}/.ready"], cwd=ROOT, check=True)
    command = [str(ROOT / venv / "bin" / "python"), str(PROOF)]
    done = subprocess.run(command, env=plain_environment(), capture_output=True, check=True)
    return json.loads(done.stdout)


def variables(emulation: Emulation) -> dict[str, str]:
    """Environment of a process under an emulation."""
    return environment(emulation, native(emulation.venv)["dispatched"])


@cache
def proven(emulation: Emulation) -> tuple[str, str]:
    """Hash of the files and of what the emulation runs on, and why it is not in effect."""
    libm = native(emulation.venv)["libm"]
    command = [str(ROOT / emulation.venv / "bin" / "python"), str(PROOF), emulation.name, libm]
    done = subprocess.run(command, env=variables(emulation), capture_output=True, text=True)
    key = hashlib.sha256((files_key() + done.stdout).encode()).hexdigest()[:12]
    return key, done.stderr.strip() if done.returncode else ""


def result(part: Part) -> dict[str, Any] | None:
    """What a part gives, now or when it was run last; None where it cannot be run here."""
    try:
        if part.emulation.needs not in native(part.emulation.venv)["features"]:
            return None
    except subprocess.CalledProcessError as error:
        return {"failed": [str(error)], "minutes": 0.0, "log": ""}
    key, refusal = proven(part.emulation)
    if refusal:
        return {"failed": [refusal], "minutes": 0.0, "log": ""}
    folder = KEPT / part.emulation.name / key
    for other in folder.parent.glob("*"):
        if other != folder:  # of other files, or of other versions
            shutil.rmtree(other)
    folder.mkdir(parents=True, exist_ok=True)
    stem = part.name.partition("/")[2]
    kept, log = folder / f"{stem}.json", folder / f"{stem}.log"
    if not kept.exists():
        start = time.monotonic()
        with log.open("w", encoding="utf-8") as file:
            command, env = part.command(folder / "results"), variables(part.emulation)
            status = subprocess.run(command, cwd=ROOT, env=env, stdout=file, stderr=file).returncode
        text = log.read_text(encoding="utf-8")
        failed = (FAILED.findall(text) or [f"exit status {status}"]) if status else []
        minutes = (time.monotonic() - start) / 60
        found = {"failed": failed, "minutes": minutes, "log": str(log.relative_to(ROOT))}
        kept.write_text(json.dumps(found), encoding="utf-8")
    return json.loads(kept.read_text(encoding="utf-8"))


def shown(results: dict[str, dict[str, Any] | None]) -> str:
    """A table of emulations and kinds, and below it what failed."""
    words = dict.fromkeys(PARTS, "-")
    for name, found in results.items():
        if found is None:
            words[name] = "left out"
        else:
            verdict = f"{len(found['failed'])} FAILED" if found["failed"] else "ok"
            words[name] = f"{verdict} {found['minutes']:.0f}"
    columns = [name.partition("/")[2] for name in PARTS if name.startswith(next(iter(EMULATIONS)))]
    rows = [["minutes", *columns]]
    rows += [[name, *(words[f"{name}/{column}"] for column in columns)] for name in EMULATIONS]
    lines = ["".join(f"{word:13}" for word in row).rstrip() for row in rows]
    for name, found in results.items():
        if found and found["failed"]:
            lines += ["", f"{name}: {found['log']}", *found["failed"]]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=["*"], help="patterns of names; all by default")
    parser.add_argument("--list", action="store_true", help="print the names as JSON, run nothing")
    asked = parser.parse_args()
    chosen = [name for name in PARTS if any(fnmatch.fnmatch(name, one) for one in asked.parts)]
    if not chosen:
        parser.error(f"no part is called {' '.join(asked.parts)}; --list names them")
    if asked.list:
        print(json.dumps(chosen))
        return
    results: dict[str, dict[str, Any] | None] = {}
    for name in chosen:
        print(f"{name} ...", flush=True)
        results[name] = result(PARTS[name])
        if results[name] is None:
            print(f"left out: this processor lacks {PARTS[name].emulation.needs}")
    print(shown(results))
    sys.exit(any(found and found["failed"] for found in results.values()))


if __name__ == "__main__":
    main()
