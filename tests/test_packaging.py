"""What a user gets: a wheel that works elsewhere, pinned requirements, a README that is true."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import nbformat
import pytest
import yaml
from packaging.requirements import Requirement

import workbench as wb
from workbench.course.execution import executed

ROOT = Path(__file__).parents[1]
SCRIPTS = "Scripts" if os.name == "nt" else "bin"
"""Where an environment keeps its programs."""


@pytest.mark.cases(0)
def test_wheel_lists_the_named_problems_from_another_folder(elsewhere, installed):
    assert "cd/focus/stadiums" in elsewhere("-m", "workbench", "list")
    where = elsewhere("-c", "import workbench; print(workbench.__file__)")
    assert where.startswith(str(installed))


def test_wheel_runs_a_named_problem_from_another_folder(elsewhere, tmp_path):
    """One that compiles nothing; CI runs others from a wheel."""
    words = ["-m", "workbench", "run", "cd/red-book", "--set", "frequencies=10"]
    assert "holds" in elsewhere(*words)
    assert list((tmp_path / "results").glob("cd/red-book/*/SHA256SUMS"))


@pytest.mark.slow  # what it needs beside the sources is looked for below, file by file
def test_wheel_reports_what_was_run(elsewhere, tmp_path):
    stored = Path("results") / "cd" / "focus" / "circles"
    shutil.copytree(
        ROOT / "results" / "reference" / stored.relative_to("results"), tmp_path / stored
    )
    elsewhere("-m", "workbench", "report")
    assert "cd/focus/circles" in (tmp_path / "results" / "index.html").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the notebook client's own event loop
def test_the_course_is_copied_from_a_wheel_and_runs_there(
    elsewhere, installed, tmp_path, monkeypatch
):
    elsewhere("-m", "workbench", "notebooks", "--to", "course")
    notebooks = sorted((tmp_path / "course").glob("*.ipynb"))
    assert len(notebooks) == 10
    monkeypatch.setenv("PYTHONPATH", str(installed))
    kept = nbformat.read(notebooks[0], as_version=4)
    kept.cells.append(nbformat.v4.new_code_cell("print(wb.__file__)"))
    made = executed(kept, tmp_path / "course")
    assert made.cells[-1].outputs[0].text.startswith(str(installed))
    assert list((tmp_path / "course").glob("results/cd/focus/circles/*/SHA256SUMS"))


IMPORT_ALL = """
import sys
import workbench.plants
from workbench.bench.project import registry

found = registry()
for name in found.entries:
    module = sys.modules[found.find(name).function.__module__]
    assert module.__name__.startswith("workbench.plants."), module
print(workbench.plants.__path__[0], *found.entries, sep="\\n")
"""


@pytest.mark.cases(0)
def test_wheel_has_every_problem_under_workbench_plants(elsewhere, installed):
    place, *names = elsewhere("-c", IMPORT_ALL).splitlines()
    assert Path(place) == installed / "workbench" / "plants"
    assert names == [entry.name for entry in wb.problems()]


@pytest.mark.cases(0)
def test_the_records_of_an_example_are_made_from_a_wheel(elsewhere, tmp_path):
    elsewhere("-m", "workbench", "examples", "--to", "mine")
    elsewhere("mine/coupled_tanks/make_records.py")
    assert len(list((tmp_path / "records").glob("*.csv"))) == 10


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a git checkout")
def test_wheel_has_every_file_of_the_checkout(installed):
    """Sources, data files, notebooks: what git keeps of `workbench`, `problems` and the rest."""
    listed = ["git", "ls-files", "workbench", "problems", "notebooks", "examples"]
    kept = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in map(Path, kept.stdout.splitlines()):
        if name == Path("workbench/plants/__init__.py"):
            continue
        inside = name
        if name.parts[0] == "problems":
            inside = Path("workbench/plants", *name.parts[1:])
        elif name.parts[0] in ("notebooks", "examples"):
            inside = Path("workbench/course", name)
        assert (installed / inside).is_file(), name


FAST = {
    "cd_drive": ("cd/red-book", {"frequencies": 10}),
    "textbook": ("textbook/fault-detection", {"frequencies": 20}),
    "cd_arm": ("cd-arm/identification", {"method": "subspace", "highest_order": 2}),
    "quick": ("quick/cart/dwell", {}),
    "strangers": ("strangers/heater/truth", {}),
}
SLOW = {
    "bench": ("bench/geometry", {"sets": 10, "points": 3, "large": 1000}),
    "mass_spring": ("mass-spring/analysis", {"tolerance": 0.4, "peers": 1}),
}
"""One problem of each folder of plants, as small as it can be; those of SLOW compile for long."""
RUN = """
import workbench as wb

for name, parameters in {!r}:
    run = wb.run(name, **parameters)
    print(name, run.outcome, run.certificate.failures)
"""


def test_every_folder_of_plants_is_run_from_the_wheel(installed):
    folders = {p.name for p in (installed / "workbench" / "plants").iterdir() if p.is_dir()}
    assert folders - {"__pycache__"} == FAST.keys() | SLOW.keys()


@pytest.mark.slow
def test_wheel_runs_a_problem_of_fast_plants(elsewhere, tmp_path):
    said = elsewhere("-c", RUN.format(list(FAST.values())))
    assert [line.split()[1] for line in said.splitlines()] == ["solved"] * len(FAST), said
    for name, _ in FAST.values():
        assert len(list((tmp_path / "results" / name).glob("*/SHA256SUMS"))) == 1


@pytest.mark.slow
def test_wheel_runs_a_problem_of_plants_that_compile_for_long(elsewhere, tmp_path):
    said = elsewhere("-c", RUN.format(list(SLOW.values())))
    assert "mass-spring/analysis solved" in said, (
        said
    )  # bench checks speed, which is not asked here
    for name, _ in SLOW.values():
        assert len(list((tmp_path / "results" / name).rglob("SHA256SUMS"))) == 1


@pytest.mark.cases(0)
def test_type_checkers_see_the_types_of_an_installed_wheel(wheel, tmp_path):
    """In an environment that has nothing else, so that only our own annotations can tell."""
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env" / SCRIPTS / "python"
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    site = subprocess.run([python, "-c", ask], capture_output=True, text=True, check=True)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site.stdout.strip())
    script = tmp_path / "script.py"
    script.write_text(
        "import workbench as wb\n"
        "reveal_type(wb.run('cd/focus/stadiums'))\n"
        "reveal_type(wb.run('cd/focus/stadiums').certificate)\n"
        "wb.run(3)\n"
    )
    words = ["--python-executable", python, "--strict", "--config-file", os.devnull]
    mypy = [sys.executable, "-m", "mypy", *words, "--cache-dir", tmp_path / "cache", script]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(mypy, cwd=tmp_path, env=environment, capture_output=True, text=True)
    first, second, third, *_ = done.stdout.splitlines()
    assert first.endswith('Revealed type is "workbench.bench.results.Run"'), done.stdout
    assert second.endswith('Revealed type is "workbench.certificate.Certificate | None"')
    assert 'incompatible type "int"; expected "str"' in third


@pytest.mark.slow
def test_pip_install_in_an_empty_environment(tmp_path):
    venv.create(tmp_path / "env", with_pip=True)
    scripts = tmp_path / "env" / SCRIPTS
    subprocess.run([scripts / "pip", "install", "-q", ROOT], check=True)
    command = [scripts / "workbench", "run", "cd/focus/stadiums", "--set", "frequencies=5"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_requirements_are_plain_pins():
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", pin) for pin in pins)


def test_every_dependency_is_pinned_and_installed_at_its_pin():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    wanted = [Requirement(t) for texts in [project["dependencies"], *extras] for t in texts]
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    pins = dict(line.lower().split("==") for line in lines if "==" in line)
    for requirement in wanted:
        pinned = pins[requirement.name.lower()]
        assert requirement.specifier.contains(pinned), requirement


def test_advice_to_install_an_extra_names_this_distribution_and_an_extra_of_it():
    """Another package has the name under which this one is imported."""
    advice = re.compile(r"([\w-]+)\[(\w+)\]['\"]")
    files = [file for top in ("workbench", "problems", "docs") for file in (ROOT / top).rglob("*")]
    texts = [file.read_text("utf-8") for file in files if file.suffix in {".py", ".md"}]
    lines = [line for text in texts for line in text.splitlines() if "pip install" in line]
    told = {found for line in lines for found in advice.findall(line)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert len(told) > 3
    assert {name for name, _ in told} == {"robust-workbench"}
    assert {extra for _, extra in told} <= extras.keys()


def test_links_of_the_readme_exist():
    text = (ROOT / "README.md").read_text()
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert links
    for link in links:
        assert (ROOT / link).exists(), link


# --- files for who cites, commits and checks ----------------------------------------------------


def test_the_citation_is_whole():
    """The keys that version 1.2.0 of the Citation File Format asks for, and the thesis."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["cff-version"] == "1.2.0" and cited["type"] == "software"
    assert cited["message"] and cited["title"]
    assert cited["authors"] == [{"name": "The workbench developers"}]
    (thesis,) = cited["references"]
    assert thesis["type"] == "thesis" and thesis["year"] == 2003
    assert thesis["title"] == "Robust and Fault Tolerant Control of CD-players"
    assert thesis["authors"][0]["family-names"] == "Vidal Sánchez"
    assert thesis["institution"]["name"] == "Aalborg University"


def test_the_version_is_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert project["version"] == wb.__version__ == str(cited["version"])
    recipe = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == wb.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## ([\d.]+)", changes, re.MULTILINE)[1] == wb.__version__
    assert project["license"] == cited["license"]


def test_commits_and_ci_run_what_lint_runs():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = re.search(r"^lint:.*\n((?:\t.+\n)+)", makefile, re.MULTILINE)
    lint = [line.strip().removeprefix("$(BIN)/") for line in recipe[1].splitlines()]
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert all(hook["language"] == "system" for hook in local["hooks"])
    hooks = [hook["entry"].removeprefix(".venv/bin/") for hook in local["hooks"]]
    assert [hook.removesuffix(" --force-exclude") for hook in hooks] == [
        line.removesuffix(" .") for line in lint
    ]
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]
    steps = [step["run"].splitlines() for step in jobs["test"]["steps"] if "run" in step]
    assert lint in steps
    made = re.search(r"^test-only:.*\n\t\$\(PYTEST\) (.+)$", makefile, re.MULTILINE)
    assert [f"python -m pytest -n auto {made[1]}"] in steps
    parts = [step.get("run", "") for step in jobs["part"]["steps"]]
    assert "make test-all-only PART=${{ matrix.part }}" in parts


def test_supported_pythons_are_those_of_ci():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]
    tested = jobs["test"]["strategy"]["matrix"]["python"]
    named = [f"Programming Language :: Python :: {version}" for version in tested]
    assert [c for c in project["classifiers"] if "Python ::" in c] == named
    assert project["requires-python"] == f">={tested[0]}"


BROUGHT_BY = {
    **{"flint": "python-flint", "PIL": "pillow"},
    **{"cycler": "matplotlib", "markupsafe": "jinja2"},
}
"""What brings a package of another name."""


@pytest.mark.cases(0)
def test_a_wheel_brings_every_package_that_the_library_imports():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    brought = {Requirement(one).name for one in declared["dependencies"]}
    optional = {
        Requirement(one).name
        for extra in declared["optional-dependencies"].values()
        for one in extra
    }
    imported = {
        name.partition(".")[0]
        for file in (ROOT / "workbench").rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        for name in imported_by(node)
    }
    outside = imported - sys.stdlib_module_names - {"workbench"}
    missing = {BROUGHT_BY.get(name, name) for name in outside} - brought
    assert missing <= optional, missing - optional
    assert missing == {
        *("distributed", "pyarrow"),  # whoever asks for them is told
        *("nbclient", "nbformat"),  # for those who make the outputs of the course anew
    }


def imported_by(node):
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and not node.level:
        return [node.module]
    return []
