"""The page of the documentation that says what is checked: `python tests/spoils/page.py`."""

from __future__ import annotations

from pathlib import Path

from collection import PROGRAMS, solved
from kinds import MEANINGS, kind_of
from spoils import SPOILS, own_variables

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "what-is-checked.md"
HEAD = """# What is checked of every answer

A certificate says that an answer *holds*. This page says of which stored numbers. A test
(`tests/spoils/test_spoils.py`) takes a small problem of every Program, changes each variable that
its answer stores and asks for the certificate again. Changes are: {spoils}. Most are caught: the
certificate fails, or the arrays are refused. The variables of which a change may pass are listed
here, with what they are:

{kinds}

Of each check the certificate says how: **proven** values come from arithmetic that bounds its own
error (exact numbers, balls, or doubles with a proven rounding); **checked** ones are computed in
doubles, and the limit beside them is the slack for that.

Metrics are not stored to be believed: `workbench verify` computes them anew from the variables, as
it does the certificate. Timings are as told. A Study says in its own checks what is checked of it.

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
