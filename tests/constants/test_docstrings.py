"""Constants say what they are, why they have their values, and what half and double change."""

import re
from pathlib import Path

from constants.listed import constants

ROOT = Path(__file__).parents[2]


def docstring(text: str, assignment: str) -> str:
    """What stands below an assignment; empty where nothing does."""
    after = text.partition(assignment)[2].lstrip()
    found = re.match(r'"""(.*?)"""', after, re.S)
    return " ".join(found[1].split()) if found else ""


def lacking(told: str) -> str:
    """What a docstring does not say; empty where it says all."""
    if not told:
        return "no docstring"
    if len(re.findall(r"[.;:](?: |$)", told)) < 2:
        return "one sentence: not why"
    if not re.search(r"\b(half|double|twice)\b", told, re.I):
        return "not what half and double do"
    return ""


def test_constants_say_what_why_and_what_half_and_double_change():
    texts, rows = {}, []
    for one in constants(ROOT):
        text = texts.setdefault(one.file, (ROOT / one.file).read_text("utf-8"))
        if missing := lacking(docstring(text, one.old)):
            rows.append(f"{one}: {missing}")
    assert not rows, "\n".join(rows)


def test_a_docstring_that_says_less_is_found():
    assert lacking("") == "no docstring"
    what, why = "Largest number of steps.", "Ten suffice."
    assert lacking(what) == "one sentence: not why"
    assert lacking(f"{what} {why}") == "not what half and double do"
    assert not lacking(f"{what} {why} Half or double changes the time.")
    assert docstring('A = 1\n"""One.\n"""\n', "A = 1") == "One."
    assert not docstring("A = 1\nB = 2\n", "A = 1")
