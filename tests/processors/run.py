"""Run the parts of `make test-all` and `make test-processors` that are not done; say what holds.

What a part gave is kept in `.processors/PLACE/KEY/`, where the key is a hash of every file of the
checkout and of what it runs on; so what was stopped goes on where it was. When it last passed, with
whatever files, and how long it took stands in `.processors/PLACE/PART.passed`.
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
from parts import HERE, PARTS, Part, Room

KEPT = ROOT / ".processors"
PROOF = Path(__file__).with_name("proof.py")
FAILED = re.compile(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", re.MULTILINE)
"""Names of tests in pytest's summary."""
PLAIN = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
"""One thread for small matrices; byte code is kept, as many tests start processes."""


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


def variables(emulation: Emulation | None) -> dict[str, str]:
    """Environment of a process under an emulation, or on this processor as it is."""
    if emulation is None:
        return plain_environment() | PLAIN
    return environment(emulation, native(emulation.venv)["dispatched"])


@cache
def proven(emulation: Emulation | None) -> tuple[str, str]:
    """Hash of the files and of what the emulation runs on, and why it is not in effect."""
    if emulation is None:
        return hashlib.sha256((files_key() + sys.version).encode()).hexdigest()[:12], ""
    libm = native(emulation.venv)["libm"]
    command = [str(ROOT / emulation.venv / "bin" / "python"), str(PROOF), emulation.name, libm]
    done = subprocess.run(command, env=variables(emulation), capture_output=True, text=True)
    key = hashlib.sha256((files_key() + done.stdout).encode()).hexdigest()[:12]
    return key, done.stderr.strip() if done.returncode else ""


def result(part: Part | Room) -> dict[str, Any] | None:
    """What a part gives, now or when it was run last; None where it cannot be run here."""
    try:
        if part.emulation and part.emulation.needs not in native(part.emulation.venv)["features"]:
            return None
    except subprocess.CalledProcessError as error:
        return {"failed": [str(error)], "minutes": 0.0, "log": ""}
    key, refusal = proven(part.emulation)
    if refusal:
        return {"failed": [refusal], "minutes": 0.0, "log": ""}
    place, _, stem = part.name.partition("/")
    folder = KEPT / place / key
    folder.mkdir(parents=True, exist_ok=True)
    for other in folder.parent.iterdir():
        if other.is_dir() and other != folder:  # of other files, or of other versions
            shutil.rmtree(other)
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
        if not failed:
            told = f"{time.strftime('%Y-%m-%d %H:%M')}, {minutes:.0f} min"
            (folder.parent / f"{stem}.passed").write_text(told, encoding="utf-8")
    return json.loads(kept.read_text(encoding="utf-8"))


def last_passed(name: str) -> str:
    """When a part last passed, with whatever files, and how long it took."""
    file = KEPT / f"{name}.passed"
    return file.read_text(encoding="utf-8") if file.exists() else "never"


def shown(results: dict[str, dict[str, Any] | None]) -> str:
    """A table of the parts, of those not run now too, and below it what failed."""
    places = {name.partition("/")[0] for name in results}
    rows = [("part", "now", "minutes", "last passed")]
    for name in (name for name in PARTS if name.partition("/")[0] in places):
        found = results.get(name)
        if found:
            verdict = f"{len(found['failed'])} FAILED" if found["failed"] else "ok"
            rows.append((name, verdict, f"{found['minutes']:.0f}", last_passed(name)))
        else:
            rows.append((name, "left out" if name in results else "-", "", last_passed(name)))
    lines = [f"{part:24}{now:12}{minutes:9}{passed}" for part, now, minutes, passed in rows]
    for name, found in results.items():
        if found and found["failed"]:
            lines += ["", f"{name}: {found['log']}", *found["failed"]]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help=f"patterns of names; all but {HERE}/* by default")
    parser.add_argument("--list", action="store_true", help="print the names as JSON, run nothing")
    parser.add_argument("--passed", action="store_true", help="print when each passed, run nothing")
    asked = parser.parse_args()
    patterns = asked.parts or [f"{name}/*" for name in EMULATIONS]
    chosen = [name for name in PARTS if any(fnmatch.fnmatch(name, one) for one in patterns)]
    if not chosen:
        parser.error(f"no part is called {' '.join(asked.parts)}; --list names them")
    if asked.list:
        print(json.dumps(chosen))
        return
    if asked.passed:
        print("\n".join(f"{name:24}{last_passed(name)}" for name in chosen))
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
