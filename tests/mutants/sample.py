"""The score of the kernel's tests against cosmic-ray's mutants: a seeded sample.

cosmic-ray is not among the requirements; it writes mutants into the checkout, so give it one of its
own:

    pip install cosmic-ray
    git worktree add ../mutants && cd ../mutants
    python tests/mutants/sample.py 40
    cosmic-ray exec tests/mutants/cosmic_ray.toml sample.sqlite
    cr-report --show-diff --surviving-only sample.sqlite

Operators that cannot change what is computed, such as those of annotations and decorators, are left
out.
"""

import random
import subprocess
import sys
from pathlib import Path

from cosmic_ray.work_db import WorkDB, use_db

CONFIG = Path(__file__).with_name("cosmic_ray.toml")
SESSION = "sample.sqlite"
SEED = 18
ARITHMETIC = {"Add", "Sub", "Mul", "Div"}
"""Binary operators that are exchanged for each other; `|` and `@` are of types and matrices."""
OTHERS = (
    "core/NumberReplacer",
    "core/ReplaceComparisonOperator",
    "core/ReplaceUnaryOperator",
    "core/ReplaceAndWithOr",
    "core/ReplaceOrWithAnd",
    "core/ReplaceTrueWithFalse",
    "core/ReplaceFalseWithTrue",
    "core/ReplaceBreakWithContinue",
    "core/AddNot",
)


def sensible(operator: str) -> bool:
    """Whether an operator changes what is computed."""
    if operator.startswith("core/ReplaceBinaryOperator"):
        return set(operator.split("_")[1:]) <= ARITHMETIC
    return operator.startswith(OTHERS)


def main(count: int) -> None:
    """Write a session of so many mutants, drawn from all sensible ones."""
    subprocess.run(["cosmic-ray", "init", CONFIG, SESSION], check=True)
    with use_db(SESSION, mode=WorkDB.Mode.open) as database:
        items = [item for item in database.work_items if sensible(item.mutations[0].operator_name)]
        every = len(items)
        chosen = random.Random(SEED).sample(sorted(items, key=place), count)
        database.clear()
        for item in chosen:
            database.add_work_item(item)
    print(f"{count} of {every} mutants in {SESSION}")


def place(item) -> tuple:
    """Where a mutant is, by which the draw is the same everywhere."""
    one = item.mutations[0]
    return str(one.module_path), one.operator_name, one.occurrence


if __name__ == "__main__":
    main(int(sys.argv[1]))
