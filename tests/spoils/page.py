"""The page of the documentation that says what is checked: `python tests/spoils/page.py`."""

from __future__ import annotations

from pathlib import Path

from collection import PROGRAMS, solved
from kinds import MEANINGS, kind_of
from spoils import SPOILS, own_variables

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "what-is-checked.md"
HEAD = """# What is checked of every answer

A certificate says that an answer *holds*. This page says for which stored numbers this was
tested. A test (`tests/spoils/test_spoils.py`) takes a small problem of every Program, changes
each variable that its answer stores, and computes the certificate again. The changes are:
{spoils}. A variable is **checked** if every change is caught: the certificate fails, or the
arrays are refused. Some changes of other variables may pass. For these variables the tables say
what they are:

{kinds}

For each check the certificate says how it was made. **Proven** values come from arithmetic that
bounds its own error (exact numbers, balls, or doubles with a proven bound of the rounding
error). **Checked** values are computed in doubles, and the limit beside them contains a slack
for rounding.

Stored metrics are not trusted: `workbench verify` computes them again from the variables, as it
does the certificate. Timings are not checked. A Study says in its own checks what is checked.

This page is made by `python tests/spoils/page.py`.
"""


def text() -> str:
    """The page."""
    kinds = "\n".join(f"- **{kind}**: {meaning}" for kind, meaning in MEANINGS.items())
    parts = [HEAD.format(spoils=", ".join(SPOILS), kinds=kinds)]
    for program, names in sorted(variables().items()):
        lines = "\n".join(rows(program, names))
        parts.append(f"## {program}\n\n| stored | what it is |\n| --- | --- |\n{lines}\n")
    return "\n".join(parts)


def rows(program: str, names: set[str]) -> list[str]:
    """The rows of the table of a Program."""
    return [f"| `{name}` | {kind_of(program, name) or 'checked'} |" for name in sorted(names)]


def variables() -> dict[str, set[str]]:
    """The variables that answers of each Program store, without those of the question."""
    found: dict[str, set[str]] = {}
    for name in PROGRAMS:
        program, answer, _ = solved(name)
        found.setdefault(type(program).__name__, set()).update(own_variables(program, answer))
    return found


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
