"""The site is true: the code of every page runs, in its order, in an empty folder."""

import contextlib
import doctest
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from tables import each

from workbench.cli import main

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = ("_build", "_tools", "course", "gallery", "reference/api")
"""Folders of what a build writes, and of its tools."""
PAGES = sorted(
    page for page in DOCS.rglob("*.md") if not page.relative_to(DOCS).as_posix().startswith(MADE)
)
BLOCK = re.compile(r"^(`{3,})(\{?[\w-]*\}?)[^\n]*\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
PYTHON = {"python", "{code-cell}"}
SHELL = {"sh"}
SHOWN = {"", "text", "c", "toml", "yaml", "bibtex", "julia", "matlab"}
"""What is read and not run: output, files of other languages, what needs another machine."""
SLOW = "% slow"
"""A comment on a page whose code takes more than a few seconds."""


def blocks(page):
    """Language and text of each block of a page that holds code; directives hold none."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    told = [(language, text) for _, language, text in found if language in PYTHON | SHELL | SHOWN]
    return [(language, text) for language, text in told if language not in SHOWN]


def directives_aside(text):
    """A cell without the options of its directive."""
    return "\n".join(line for line in text.splitlines() if not line.startswith(":")) + "\n"


def with_code():
    for page in PAGES:
        if blocks(page) and page.name not in {"solvers.md", "clusters.md", "extend.md"}:
            # These have tests of their own: test_guides, test_contributing.
            text = page.read_text(encoding="utf-8")
            name = page.relative_to(DOCS).as_posix()
            marks = [pytest.mark.slow] if SLOW in text else []
            yield pytest.param(page, id=name, marks=marks)


@pytest.mark.cases(1)
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("page", list(with_code()))
def test_code_of_a_page_runs(page, project):
    space = {"__name__": "page"}
    for number, (language, text) in enumerate(blocks(page)):
        if language in SHELL:
            for line in text.replace("\\\n", " ").splitlines():
                command(line.partition("  #")[0], project)
        elif text.lstrip().startswith(">>>"):
            session(text, space, f"{page.name}, block {number}")
        else:
            named = re.match(r"# ([\w/.-]+\.(?:py|toml))\n", text)
            if named:
                project.write(named[1], text)
                project.restart()
            else:
                with contextlib.redirect_stdout(io.StringIO()):
                    exec(compile(directives_aside(text), f"{page.name}:{number}", "exec"), space)


def test_the_readme_prints_what_it_says():
    (text,) = [text for language, text in blocks(ROOT / "README.md") if language in PYTHON]
    session(text, {}, "README.md")


def session(text, space, name):
    """Run a session of an interpreter and compare what it prints."""
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    test = doctest.DocTestParser().get_doctest(text, space, name, name, 0)
    test.globs = space
    out = io.StringIO()
    runner = doctest.DocTestRunner(optionflags=flags)
    runner.run(test, out=out.write, clear_globs=False)
    assert runner.failures == 0, out.getvalue()


def command(line, project):
    """Run a command of a page, which must end well."""
    words = shlex.split(line)
    if not words:
        return
    if words[0] == "cd":
        os.chdir(words[1])  # the fixture goes back
    elif words[0] == "python":
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, *words[1:]], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    else:
        assert words[0] == "workbench", line
        project.restart()
        done = CliRunner().invoke(main, words[1:])
        assert done.exit_code == 0, (line, done.output, done.exception)


@each("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_links_of_a_page_exist(page):
    """Links to files of the repository; the build checks those between pages."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for link in re.findall(r"\]\(([^)#\s]+)", text):
        if "://" not in link and not link.startswith(("#", "mailto:")):
            target = page.parent / link
            made = target.resolve().is_relative_to(DOCS) and target.resolve().relative_to(
                DOCS
            ).as_posix().startswith(MADE)
            assert made or target.exists() or target.with_suffix(".md").exists(), link


def test_every_page_is_reached():
    """Each page stands in a list of pages of another."""
    lists = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    for page in PAGES:
        name = page.relative_to(DOCS).as_posix()
        if name == "index.md" or name.startswith("reference/examples/"):
            continue
        stem = page.parent.name if page.name == "index.md" else page.stem
        assert re.search(rf"^(?:.* <)?(\.\./|[\w/-]+/)*{stem}(/index)?>?$", lists, re.MULTILINE), (
            name
        )
