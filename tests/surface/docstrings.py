"""What docstrings say of names, and in which units: sections, tables, prose, texts below fields."""

from __future__ import annotations

import ast
import functools
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}\n", re.MULTILINE)
ENTRY = re.compile(r"^(\w+(?:, \w+)*)(?: : .*)?$")
"""The line of a section that names one or more parameters; what is said of them is set in."""
ROW = re.compile(r"^(\w+(?:, \w+)*)(?:: |  +)(?=\S)")
"""The line of a docstring that begins a row of a table: names, two blanks or a colon, text."""
UNIT = r"Hz|rad/s|rad|deg(?:rees)?|samples?|s"
BRACKETS = re.compile(rf"\[({UNIT})\]")
QUOTED = r"`+\w+`+(?:(?:, | and | or | to )`+\w+`+)*"
SHAPE = r"(?: \([^()]*\))?"
INLINE = (
    re.compile(rf"(?P<names>{QUOTED}|\b\w+){SHAPE} \[(?P<unit>{UNIT})\]"),
    re.compile(rf"(?P<names>{QUOTED}){SHAPE}:(?: \w+){{1,3}} \[(?P<unit>{UNIT})\]"),
    re.compile(rf"(?P<names>{QUOTED}){SHAPE} in (?P<unit>Hz|rad/s|degrees|samples)\b"),
)
"""Names in prose with their unit: ``low`` to ``high`` [Hz]; omega (F,) [rad/s]; ``phases`` (K, 2):
phase margin [deg]; ``x`` in Hz."""


def own_classes(cls: type) -> Iterator[type]:
    """A class and its bases that the same project defines."""
    project = cls.__module__.partition(".")[0]
    return (base for base in cls.__mro__ if base.__module__.partition(".")[0] == project)


def words_of(cls: type) -> dict[str, tuple[str, str]]:
    """What is said of the fields and parameters of a class, and their units, by name."""
    found: dict[str, tuple[str, str]] = {}
    for base in reversed([*own_classes(cls)]):
        found |= documented(inspect.cleandoc(vars(base).get("__doc__") or ""))
        found |= _below_fields(base)
        made = vars(base).get("__init__")
        found |= documented(inspect.getdoc(made) or "") if inspect.isfunction(made) else {}
    return found


def documented(docstring: str) -> dict[str, tuple[str, str]]:
    """What a docstring says of each name, and the unit: sections, tables, names in prose."""
    head, *rest = SECTION.split(docstring)
    sections = dict(zip(rest[::2], rest[1::2], strict=True))
    found = dict.fromkeys(re.findall(r"`(\w+)`", head), (head, ""))
    found |= {name: (head, unit) for name, unit in in_prose(head).items()}
    blocks = _blocks(head, ROW)
    for title in ("Parameters", "Other Parameters", "Attributes"):
        blocks += _blocks(sections.get(title, ""), ENTRY)
    for names, text in blocks:
        inline, units = in_prose(text), _units(text)
        each = units if len(units) == len(names) else units[:1] * len(names) or [""] * len(names)
        for name, unit in zip(names, each, strict=True):
            found[name] = (text, inline.get(name) or unit)
    return found


def in_prose(text: str) -> dict[str, str]:
    """Units that a text puts behind names."""
    found: dict[str, str] = {}
    line = " ".join(text.split())
    for match in (match for pattern in INLINE for match in pattern.finditer(line)):
        for name in re.findall(r"\w+", re.sub(r" (and|or|to) ", " ", match["names"])):
            found.setdefault(name, _plain(match["unit"]))
    return found


def unit_of(text: str) -> str:
    """The first unit in brackets in the first sentence of what is said of one name."""
    return next(iter(_units(text)), "")


def _units(text: str) -> list[str]:
    """The units in brackets in the first sentence of a text."""
    sentence = re.split(r"\.(?:\s|$)|;", text, maxsplit=1)[0]
    return [_plain(unit) for unit in BRACKETS.findall(sentence)]


def _plain(unit: str) -> str:
    return {"degrees": "deg", "sample": "samples"}.get(unit, unit)


def _blocks(text: str, begins: re.Pattern[str]) -> list[tuple[list[str], str]]:
    """Names and texts of the entries of a section, or of the rows of a table."""
    found: list[tuple[list[str], list[str]]] = []
    for line in text.splitlines():
        match = begins.match(line)
        if match:
            found.append((match[1].split(", "), [line[match.end() :]]))
        elif found and (line.startswith("  ") or not line):
            found[-1][1].append(line.strip())
    return [(names, "\n".join(lines).strip()) for names, lines in found]


@functools.cache
def _classes_of(file: str) -> dict[str, ast.ClassDef]:
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}


def _below_fields(cls: type) -> dict[str, tuple[str, str]]:
    """The texts that stand below the fields of a class."""
    file = getattr(sys.modules.get(cls.__module__), "__file__", None)
    node = _classes_of(file).get(cls.__name__) if file else None
    found: dict[str, tuple[str, str]] = {}
    for field, text in zip(node.body, node.body[1:], strict=False) if node else ():
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(said))),
            ):
                found[name] = (said, unit_of(said))
    return found
