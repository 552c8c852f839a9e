"""Halves and doubles drawn constants, and tells which test feels each change.

    python tests/constants/run.py            runs the trials that are left
    python tests/constants/run.py --table    prints what they found

A trial imports the module from a changed text and runs the fast tests that lead to the constant,
the nearest first, until one fails or the processor time is used up. Each found line is kept in
`.pytest_cache`, and a stopped run goes on after it. Code that is compiled in another module keeps
the constant that it was compiled with: there, a change is not felt by this.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import sys
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests" / "mutants")]

from constants.listed import FACTORS, Constant, constants  # noqa: E402
from quick.chosen import FAR  # noqa: E402
from quick.edits import chosen  # noqa: E402
from quick.graph import Graph  # noqa: E402

SEED = 69
FOUND = ROOT / ".pytest_cache" / "constants.jsonl"


def drawn(count: int) -> list[Constant]:
    """Constants drawn from all those of the rooms; one that goes or comes changes one of them."""
    every = constants(ROOT)
    every.sort(key=lambda one: sha256(f"{SEED} {one}".encode()).digest())
    return every[:count]


def trial(graph: Graph, one: Constant, factor: str, nearest: int, seconds: int) -> str:
    """The test that fails with a changed constant; "none" or "none in time" where none does."""
    module = one.file.removesuffix(".py").replace("/", ".")
    change = {"module": module, "old": one.old, "new": one.times(FACTORS[factor])}
    found = chosen(graph, [one.node])
    near = sorted(
        (distance, file, name)
        for file, each in found.tests.items()
        for name, distance in each.items()
        if distance < FAR
    )[:nearest]
    if not near:
        return "none leads to it"
    told = ROOT / ".pytest_cache" / "constant.json"
    tests: dict[str, dict[str, int]] = {}
    for distance, file, name in near:
        tests.setdefault(file, {})[name] = distance
    told.write_text(json.dumps(found.to_json() | {"tests": tests}), encoding="utf-8")
    printed = told.with_suffix(".txt")
    child = os.fork()
    if child == 0:  # nothing of workbench is imported yet
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        os.environ["WORKBENCH_MUTANT"] = json.dumps(change)
        where = os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(where, 1)
        os.dup2(where, 2)
        import pytest

        words = ["-x", "-q", "-p", "mutated", "-p", "no:cacheprovider", "-m", "not slow", "--tb=no"]
        status = pytest.main([*words, "--chosen", str(told), *tests])
        sys.stdout.flush()
        os._exit(int(status))
    status = os.waitpid(child, 0)[1]
    said = printed.read_text(encoding="utf-8")
    if failed := re.search(r"^(?:FAILED|ERROR) (\S+)", said, re.M):
        return failed[1]
    if os.WIFSIGNALED(status):
        return "none in time"
    code = os.waitstatus_to_exitcode(status)
    return {0: "none", 5: "no fast test"}.get(code, f"not run: {said.splitlines()[-1:]}")


def main(count: int, nearest: int, seconds: int) -> None:
    """Run the trials of which no line is kept yet."""
    import control  # noqa: F401  (imported once for all trials)
    import pytest  # noqa: F401
    import scipy.optimize  # noqa: F401
    import xarray  # noqa: F401

    FOUND.parent.mkdir(exist_ok=True)
    known = {(line["constant"], line["factor"]) for line in lines()}
    graph = Graph(ROOT)
    for one in drawn(count):
        for factor in FACTORS:
            if (str(one), factor) not in known:
                felt = trial(graph, one, factor, nearest, seconds)
                line = {"constant": str(one), "factor": factor, "felt": felt}
                with FOUND.open("a", encoding="utf-8") as kept:
                    kept.write(json.dumps(line) + "\n")
                print(f"{one} {factor}: {felt}", flush=True)


def lines() -> list[dict[str, str]]:
    """What earlier trials found."""
    if not FOUND.is_file():
        return []
    return [json.loads(line) for line in FOUND.read_text(encoding="utf-8").splitlines()]


def table() -> str:
    """What is known of each constant: which test feels it halved, and which doubled."""
    felt: dict[str, dict[str, str]] = {}
    for line in lines():
        felt.setdefault(line["constant"], {})[line["factor"]] = line["felt"]
    rows = [
        f"| `{name}` | {each.get('half', '')} | {each.get('double', '')} |"
        for name, each in sorted(felt.items())
    ]
    return "\n".join(["| constant | half | double |", "| --- | --- | --- |", *rows])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--nearest", type=int, default=40, help="most test functions of a trial")
    parser.add_argument("--seconds", type=int, default=60, help="processor time of a trial")
    parser.add_argument("--table", action="store_true")
    asked = parser.parse_args()
    print(table()) if asked.table else main(asked.count, asked.nearest, asked.seconds)
