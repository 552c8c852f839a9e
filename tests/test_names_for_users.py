"""What users read imports public names alone, each from its room; and every public name has a use.

Users learn from pages, examples, notebooks and problems. So all that these import has a page with
an example that runs, and obeys the laws of the surface. A function that neither they nor other
modules of the library use is a promise that nobody asked for.
"""

import ast
import importlib
import inspect
import json
import re
from collections import defaultdict
from pathlib import Path

from surface.reading import reference

ROOT = Path(__file__).parents[1]
FENCE = re.compile(
    r"^```(?:python|pycon|\{code-cell\}[^\n]*)?\n(.*?)^```", re.MULTILINE | re.DOTALL
)
PROMPT = re.compile(r"^(?:>>>|\.\.\.) ?", re.MULTILINE)
INNER_PARTS = {
    "docs/benchmarks.py": "draws a page of the bench from the bench's own layout",
    "docs/study.py": "draws a page of the bench from the bench's own layout",
    "docs/explained/machine-code.md": "times machine code beside the plain way",
    "problems/bench/cd_arm.py": "compares every use and candidate of a fit with a peer's",
    "problems/bench/covers.py": "measures a step of a cover by itself",
    "problems/bench/matrix_sets.py": "measures a step of a cover by itself",
    "problems/bench/mu_lower_yardstick.py": "measures the proposals before they are proven",
    "problems/bench/mu_yardstick.py": "measures a bound before it is proven",
    "problems/bench/norms.py": "times what a norm and its Riccati equations take by themselves",
    "problems/bench/records/judge.py": "judges peers by the folds that a fit judges its own by",
    "problems/bench/records/linear_peers.py": "gives peers' models the gains of ours",
    "problems/bench/records/narx_peer.py": "scales a record as the fit does",
    "problems/bench/records/summary.py": "compares every use of a fit",
    "problems/bench/regions/covers.py": "measures a region before a cover takes it",
    "problems/bench/regions/judged.py": "measures a step of a response by itself",
    "problems/bench/synthesis.py": "times the Riccati equations by themselves",
    "problems/cd_drive/claims/values/covers.py": "repeats the thesis's own construction of covers",
    "problems/cd_drive/control/five_x/checks.py": "samples the sets within a bound's proof",
    "problems/cd_drive/control/trade_off.py": "tries many controllers and certifies the last alone",
}
"""Files that measure inner parts or draw what the bench stores, and why: these may import them."""
LISTS = {"migration.md", "types.md", "what-is-checked.md"}
"""Pages that list names whether somebody uses them or not."""


def test_names_that_users_read_are_public():
    allowed = public_names()
    found = defaultdict(set)
    for file, module, name in imports():
        if name not in allowed.get(module, ()) and file not in INNER_PARTS:
            found[module, name].add(file)
    table = [
        f"{module}: {name}  {', '.join(sorted(files))}" for (module, name), files in found.items()
    ]
    assert not table, "\n".join(sorted(table))


def test_files_that_may_import_inner_parts_do():
    """No reason is left over."""
    allowed = public_names()
    inner = {file for file, module, name in imports() if name not in allowed.get(module, ())}
    assert INNER_PARTS.keys() - inner == set()


def test_inner_parts_are_found():
    """A module, a room's module and a name without a page are no public names."""
    code = (
        "import workbench.mu.upper\nfrom workbench.mu import lower\nfrom workbench.api import run\n"
    )
    allowed = public_names()
    found = list(imported(code))
    assert len(found) == 3
    assert not any(name in allowed.get(module, ()) for module, name in found)


def test_every_public_name_has_a_use():
    """A function is called by another file, or a page names it. A class may be what a function
    of its own file returns.
    """
    pages, used = reference(), defaultdict(set)
    for page in (ROOT / "docs").rglob("*.md"):
        if page.name not in LISTS and not {"api", "_build", "gallery"} & {*page.parts}:
            for name in re.findall(r"\w+", page.read_text(encoding="utf-8")):
                used[name].add(page)
    for file in sorted((ROOT / "workbench").rglob("*.py")):
        for word in words_of(file.read_text(encoding="utf-8")):
            used[word].add(file)
    for file, code in read_by_users():
        for word in words_of(code):
            used[word].add(file)
    table = []
    for room in pages.ROOMS:
        for name in pages.public_names(importlib.import_module(room)):
            thing = inspect.unwrap(getattr(importlib.import_module(room), name))
            own = {Path(thing.__code__.co_filename)} if inspect.isfunction(thing) else set()
            if not used[name] - own:
                table.append(f"{room}.{name}")
    assert not table, "used nowhere: " + ", ".join(table)


def words_of(code):
    """Names and attributes in code; what is imported only, or stands in ``__all__``, is no use."""
    nodes = list(statements(code))
    return {n.id for n in nodes if isinstance(n, ast.Name)} | {
        n.attr for n in nodes if isinstance(n, ast.Attribute)
    }


def public_names():
    """Names by room; the rooms themselves are names of the package."""
    pages = reference()
    found = {room: set(pages.public_names(importlib.import_module(room))) for room in pages.ROOMS}
    for room in pages.ROOMS:
        parent, _, name = room.rpartition(".")
        found.setdefault(parent, set()).add(name)
        found[room].add("*")  # the room as a whole
    return found


def imports():
    """File, module and name of every import from the workbench in what users read."""
    for name, code in read_by_users():
        yield from ((name, *one) for one in imported(code))


def read_by_users():
    """File and code of problems, examples, pages, notebooks and templates."""
    for place, pattern in (
        ("problems", "*.py"), ("examples", "*.py"), ("docs", "*.py"), ("docs", "*.md"),
        ("notebooks", "*.ipynb"), ("workbench/starter", "*.jinja"), (".", "README.md"),
    ):  # fmt: skip
        files = (ROOT / place).glob(pattern) if place == "." else (ROOT / place).rglob(pattern)
        for file in sorted(files):
            name = file.relative_to(ROOT).as_posix()
            if not name.startswith(("docs/_", "docs/reference/api/")):
                yield from ((name, code) for code in codes(file))


def codes(file):
    """The code of a file: all of it, its cells, or the fenced blocks of a page."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        return ["".join(one["source"]) for one in cells if one["cell_type"] == "code"]
    if file.suffix == ".md":
        return [PROMPT.sub("", block) for block in FENCE.findall(text)]
    return [text]


def imported(code):
    """Module and name of each import from the workbench; ``"*"`` for a module as a whole."""
    for node in statements(code):
        if isinstance(node, ast.Import):
            found = [(one.name, "*") for one in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found = [(node.module or "", one.name) for one in node.names]
        else:
            continue
        for module, name in found:
            own = module == "workbench" or module.startswith("workbench.")
            if own and not module.startswith("workbench.plants"):
                yield module, name


def statements(code):
    """All nodes of code; of a session with its output, or of a template, line by line."""
    try:
        return list(ast.walk(ast.parse(code)))
    except SyntaxError:
        return [
            node for line in code.splitlines() for one in parsed(line) for node in ast.walk(one)
        ]


def parsed(line):
    """The statement of a line; nothing if it is none."""
    try:
        return ast.parse(line.strip()).body
    except SyntaxError:
        return []
