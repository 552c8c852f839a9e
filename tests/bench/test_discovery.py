"""Names and help are read from the sources; nothing is imported."""

import pytest

from workbench.bench.discovery import scan
from workbench.bench.problem import axis_values
from workbench.errors import RegistryError

HEAD = "from workbench import problem\n\n"


def found(folder, text, name="problems.py"):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(HEAD + text)
    every = list(scan(folder, axis_values))
    for one in every:
        if isinstance(one, RegistryError):
            raise one
    return every


def test_a_name_with_its_help(tmp_path):
    text = (
        '@problem("a/b", slow=True)\ndef f(n: int = 3):\n    """One line.\n\n    More.\n    """\n'
    )
    (entry,) = found(tmp_path, text, "deep/down/problems.py")
    assert (entry.name, entry.summary, entry.slow) == ("a/b", "One line.", True)
    assert entry.help == "One line.\n\nMore."
    assert entry.file == tmp_path / "deep/down/problems.py"
    assert entry.place == f"{entry.file}:f"
    assert entry.file.read_text().splitlines()[entry.line - 1] == "def f(n: int = 3):"


def test_help_may_be_missing(tmp_path):
    (entry,) = found(tmp_path, '@problem("a")\ndef f(): ...\n')
    assert (entry.help, entry.summary, entry.slow) == ("", "", False)


def test_a_summary_is_a_whole_paragraph_in_one_line(tmp_path):
    text = '@problem("a/b")\ndef one():\n    """Begins here\n    and ends there.\n\n    More."""\n'
    (tmp_path / "problems.py").write_text(text)
    (entry,) = scan(tmp_path, axis_values)
    assert entry.summary == "Begins here and ends there."


def test_a_template_gives_a_name_for_every_place_of_its_axes(tmp_path):
    text = '@problem("a/{x}/{n}", x=("u", "v"), n=("1", "2"), data="d.csv")\ndef f(x, n): ...\n'
    entries = found(tmp_path, text)
    assert [entry.name for entry in entries] == ["a/u/1", "a/u/2", "a/v/1", "a/v/2"]
    assert entries[1].axes == {"x": "u", "n": "2"}


@pytest.mark.parametrize("spelling", ["problem", "wb.problem", "workbench.bench.problem"])
def test_the_decorator_may_be_spelled_through_its_module(tmp_path, spelling):
    assert [e.name for e in found(tmp_path, f'@{spelling}("a")\ndef f(): ...\n')] == ["a"]


@pytest.mark.parametrize(
    "text", ["", "def f(): ...", "@other('a')\ndef f(): ...", "# @problem('a')", "x = problem('a')"]
)
def test_what_is_no_problem_is_passed_over(tmp_path, text):
    assert found(tmp_path, text) == []


def test_a_file_that_cannot_be_imported_is_listed(tmp_path):
    text = 'raise RuntimeError("no")\n\n@problem("a")\ndef f():\n    """Help."""\n'
    assert [(e.name, e.help) for e in found(tmp_path, text)] == [("a", "Help.")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("@problem(NAME)\ndef f(): ...", "problems.py:3: the name must be a literal"),
        ('@problem(f"a/{1}")\ndef f(): ...', "the name must be a literal"),
        ('@problem("a", slow=SLOW)\ndef f(): ...', "slow must be a literal"),
        ('@problem("a/{x}", x=AXES)\ndef f(x): ...', "axis x must be a literal"),
        ('@problem("a/{x}")\ndef f(x): ...', "needs an axis for 'x'"),
        ('@problem("a/{}", x=("u",))\ndef f(x): ...', "needs an axis"),
        ('@problem("a/{x}", x="focus")\ndef f(x): ...', "axis x"),  # a comma is missing
        ('@problem("a/{x}", x=3)\ndef f(x): ...', "axis x"),
        ("@problem(3)\ndef f(): ...", "name"),
        ("@problem()\ndef f(): ...", "takes one name, here 0"),
        ('@problem("a", "b")\ndef f(): ...', "takes one name, here 2"),
        ('@problem("a")\ndef f(: ...', "problems.py:4: "),
    ],
)
def test_what_cannot_be_read_is_an_error_that_names_file_and_line(tmp_path, text, words):
    with pytest.raises(RegistryError, match=words) as error:
        found(tmp_path, text)
    assert "problems.py:" in str(error.value)


@pytest.mark.parametrize("name", ["", "/top", "../up", "a/../../up", "a//b", "a/./b", ".partial/a"])
def test_a_name_must_be_a_path_below_the_results(tmp_path, name):
    with pytest.raises(RegistryError, match="name"):
        found(tmp_path, f'@problem("{name}")\ndef f(): ...')


@pytest.mark.parametrize("name", ["compare", "reference/a"])
def test_a_name_may_not_take_a_place_that_the_bench_uses(tmp_path, name):
    with pytest.raises(RegistryError, match="name"):
        found(tmp_path, f'@problem("{name}")\ndef f(): ...')


def test_a_file_in_another_encoding_is_an_error_that_names_it(tmp_path):
    (tmp_path / "problems.py").write_bytes(b"# caf\xe9\n@problem('a')\ndef f(): ...\n")
    (error,) = scan(tmp_path, axis_values)
    assert isinstance(error, RegistryError) and "problems.py" in str(error)


def test_a_broken_file_costs_its_own_names_only(tmp_path):
    (tmp_path / "a.py").write_text("@problem('a'\n")
    (tmp_path / "b.py").write_text(HEAD + "@problem('b')\ndef f(): ...\n")
    (tmp_path / "c.py").symlink_to(tmp_path / "gone")
    deep = "@problem('d')\ndef f(): " + "(" * 5000 + ")" * 5000
    (tmp_path / "d.py").write_text(deep)
    first, entry, gone, deep = scan(tmp_path, axis_values)
    assert [isinstance(one, RegistryError) for one in (first, gone, deep)] == [True] * 3
    assert entry.name == "b"


def test_a_folder_must_exist(tmp_path):
    with pytest.raises(RegistryError, match="missing does not exist"):
        list(scan(tmp_path / "missing", axis_values))
