"""A function's signature is the problem's parameters, its docstring the help."""

import math

import numpy as np
import pytest
from tables import each

from workbench.bench.declare import Ref
from workbench.bench.question import canonical
from workbench.bench.registry import Registry
from workbench.errors import InputError, RegistryError, UnknownNameError

HEAD = """
from __future__ import annotations
from typing import Annotated, Literal, Optional
from pydantic import Field
from workbench import problem, ref

"""


@pytest.fixture
def problem(project):
    """The problem that a source text registers last."""

    def make(text):
        project.write("plants/other/problems.py", HEAD + text)
        registry = Registry([project.root / "plants"])
        own = [e for e in registry.entries.values() if e.file.parent.name == "other"]
        return registry.find(own[-1].name)

    return make


# --- parameters -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "given", "value"),
    [
        ("int", "3", 3),
        ("int", 3.0, 3),
        ("float", "0.5", 0.5),
        ("float", "1e3", 1000.0),
        ("float", 2, 2.0),
        ("bool", "true", True),
        ("bool", "no", False),
        ("bool", "0", False),
        ("str", "3", "3"),
        ("Literal['a', 'b']", "b", "b"),
        ("Optional[float]", None, None),
        ("Optional[float]", "null", None),
        ("float | None", "2", 2.0),
        ("list[float]", "[1, 2.5]", [1.0, 2.5]),
        ("list[float]", [1, "2"], [1.0, 2.0]),
        ("tuple[int, ...]", "[1, 2]", (1, 2)),
        ("dict[str, int]", '{"a": 1}', {"a": 1}),
        ("Annotated[int, Field(ge=2)]", "2", 2),
    ],
)
def test_a_value_is_converted_to_the_type_of_its_parameter(problem, kind, given, value):
    bound = problem(f'@problem("a")\ndef f(p: {kind}): ...\n').bind({"p": given})["p"]
    assert bound == value
    assert type(bound) is type(value)


@pytest.mark.parametrize(
    ("kind", "given", "words"),
    [
        ("int", "three", "valid integer"),
        ("int", "1.5", "valid integer"),
        ("int", 1.5, "fractional"),
        ("float", "wide", "valid number"),
        ("bool", "perhaps", "valid boolean"),
        ("Literal['a', 'b']", "c", "'a' or 'b'"),
        ("list[float]", "1, 2", "valid list"),
        ("float", None, "valid number"),
        ("Annotated[int, Field(ge=2)]", "1", "greater than or equal to 2"),
    ],
)
def test_a_value_that_does_not_fit_is_named_with_the_reason(problem, kind, given, words):
    with pytest.raises(InputError, match=rf"^a: p={given!r} does not fit: .*{words}"):
        problem(f'@problem("a")\ndef f(p: {kind}): ...\n').bind({"p": given})


def test_defaults_are_filled_in(problem):
    assert problem('@problem("a")\ndef f(p: int = 3, q: str = "x"): ...').bind({"q": "y"}) == {
        "p": 3,
        "q": "y",
    }


def test_a_default_is_the_same_as_giving_its_value(problem):
    one = problem('@problem("a")\ndef f(p: float = 1, q: tuple[float, ...] = (1, 2)): ...')
    by_default, given = one.bind({}), one.bind({"p": 1, "q": [1, 2]})
    assert repr(one.to_json(by_default)) == repr(one.to_json(given))


def test_a_parameter_without_default_must_be_given(problem):
    one = problem('@problem("a")\ndef f(p: int): ...')
    with pytest.raises(InputError, match="a needs a value for p"):
        one.needs(one.bind({}))


def test_an_unknown_parameter_suggests_the_nearest(problem):
    with pytest.raises(UnknownNameError, match=r"no parameter of a is called 'wdith'.*width"):
        problem('@problem("a")\ndef f(width: int = 1): ...').bind({"wdith": 1})


def test_axes_are_passed_and_not_set(problem):
    one = problem('@problem("a/{x}", x=("u", "v"))\ndef f(x: str, n: int = 1): ...')
    assert one.name == "a/v"
    assert one.bind({}) == {"x": "v", "n": 1}
    with pytest.raises(UnknownNameError, match="no parameter of a/v is called 'x'"):
        one.bind({"x": "u"})


def test_an_axis_must_be_a_parameter(problem):
    with pytest.raises(RegistryError, match="no parameter for axis x"):
        problem('@problem("a/{x}", x=("u",))\ndef f(): ...')


@pytest.mark.parametrize("value", [0.1, float("inf"), float("nan"), None, (1, 2)], ids=str)
def test_stored_parameters_bind_again(problem, value):
    one = problem('@problem("a")\ndef f(p: float | None | tuple[int, ...] = None): ...')
    stored = one.to_json(one.bind({"p": value}))
    assert repr(one.to_json(one.bind(stored))) == repr(stored)


def test_an_annotation_that_cannot_be_resolved_is_an_error_that_names_it(problem):
    with pytest.raises((RegistryError, InputError), match="Missing"):
        problem('@problem("a")\ndef f(p: Missing = 1): ...').bind({"p": 1})


# --- needs and data ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("needs", "expected"),
    [
        ('{"up": ref("toy/root")}', {"up": Ref("toy/root")}),
        (
            '{"up": ref("toy/root", method="rough", scale=2)}',
            {"up": Ref("toy/root", "rough", {"scale": 2})},
        ),
        ('{"up": ref("toy/{x}/root")}', {"up": Ref("toy/u/root")}),
        (
            '{"up": [ref("toy/{x}/root"), ref("toy/root")]}',
            {"up": [Ref("toy/u/root"), Ref("toy/root")]},
        ),
        ('lambda x, n: {"up": ref(f"toy/{x}", scale=n)}', {"up": Ref("toy/u", None, {"scale": 3})}),
        ('lambda x, **_: {"up": ref(f"toy/{x}")}', {"up": Ref("toy/u")}),
        (
            'lambda x, n: {"up": [ref(x, k=k) for k in range(n)]}',
            {"up": [Ref("u", None, {"k": k}) for k in range(3)]},
        ),
        ("None", {}),
    ],
)
def test_needs_are_a_dictionary_or_a_function_of_the_parameters(problem, needs, expected):
    up = "up, " if expected else ""
    one = problem(
        f'@problem("a/{{x}}", x=("u",), needs={needs})\ndef f({up}x: str, n: int = 3): ...'
    )
    bound = one.bind({})
    assert bound == {"x": "u", "n": 3}
    assert one.needs(bound) == expected


@pytest.mark.parametrize("needs", ['{"up": ref("b")}', 'lambda: {"up": ref("b")}'])
def test_an_argument_that_is_fed_may_be_annotated(problem, needs):
    one = problem(f'@problem("a", needs={needs})\ndef f(up: object, n: int = 3): ...')
    assert one.bind({}) == {"n": 3}


def test_a_run_with_a_default_is_fed_only_where_a_need_says_so(problem):
    one = problem(
        "from workbench import Run\n"
        'def needs(fed=False, **_): return {"up": ref("b")} if fed else {}\n'
        '@problem("a", needs=needs)\n'
        "def f(up: Run | None = None, fed: bool = False): ..."
    )
    assert list(one.parameters) == ["fed"]
    assert one.needs(one.bind({})) == {}
    assert one.needs(one.bind({"fed": True})).keys() == {"up"}
    with pytest.raises(UnknownNameError, match="up"):
        one.bind({"up": None})


def test_a_need_that_the_function_does_not_take_is_an_error(problem):
    with pytest.raises(RegistryError, match="down"):
        one = problem('@problem("a", needs={"down": ref("b")})\ndef f(n: int = 3): ...')
        one.needs(one.bind({}))


def test_a_reference_over_an_unknown_axis_is_an_error(problem):
    with pytest.raises(RegistryError, match="y"):
        one = problem('@problem("a", needs={"up": ref("b/{y}")})\ndef f(up): ...')
        one.needs(one.bind({}))


def test_data_files_are_hashed_and_may_not_be_missing(project, problem):
    one = problem('@problem("a", data=("one.csv", "../toy/targets.csv"))\ndef f(): ...')
    with pytest.raises(InputError, match=r"a: data file .*one\.csv cannot be read: No such file"):
        one.data_hashes()
    project.write("plants/other/one.csv", "1")
    hashes = one.data_hashes()
    assert hashes.keys() == {"one.csv", "../toy/targets.csv"}
    assert len(set(hashes.values())) == 2
    project.write("plants/other/one.csv", "2")
    assert one.data_hashes()["one.csv"] != hashes["one.csv"]


# --- names ------------------------------------------------------------------------------------


def registry(project, *roots):
    return Registry([project.root / root for root in (roots or ("plants",))])


def test_names_are_sorted_and_matched_by_shell_patterns(project):
    here = registry(project)
    assert list(here.entries) == sorted(here.entries)
    assert [e.name for e in here.match("toy/?/root")] == ["toy/x/root", "toy/y/root"]
    assert [e.name for e in here.match("*/loop/[ab]")] == ["toy/loop/a", "toy/loop/b"]


@pytest.mark.parametrize("verb", ["find", "match"])
@pytest.mark.parametrize(
    ("name", "words"),
    [("toy/rot", "did you mean .*toy/root"), ("qqq", "known: .*toy/root")],
)
def test_an_unknown_name_suggests_the_nearest_or_lists_all(project, verb, name, words):
    with pytest.raises(UnknownNameError, match=f"no problem is called '{name}'; {words}"):
        getattr(registry(project), verb)(name)


def test_one_name_for_two_functions_is_an_error_that_names_both(project):
    project.write("more/again.py", '@problem("toy/root")\ndef again(): ...\n')
    words = r"two problems are called 'toy/root': .*problems\.py:root and .*again\.py:again"
    with pytest.raises(RegistryError, match=words):
        registry(project, "plants", "more").find("toy/root")


def test_a_parameter_named_like_an_option_is_refused(problem):
    with pytest.raises(RegistryError, match=r"a parameter may not be called seed, tolerance, as"):
        problem('@problem("a")\ndef f(seed: int = 1, tolerance: float = 2.0): ...\n')


def test_a_file_that_raises_at_import_is_listed_and_says_so_when_found(project):
    text = 'raise RuntimeError("no luck")\n@problem("bad")\ndef f():\n    """Help."""\n'
    project.write("plants/bad.py", text)
    here = registry(project)
    assert here.match("bad")[0].help == "Help."
    with pytest.raises(RegistryError, match=r"bad\.py cannot be imported: RuntimeError: no luck"):
        here.find("bad")


def test_files_of_the_same_name_in_two_folders_do_not_clash(project):
    for root in ("one", "two"):
        text = f'{HEAD}@problem("{root}")\ndef f():\n    return "{root}"\n'
        project.write(f"{root}/same/problems.py", text)
    here = registry(project, "one", "two")
    assert [here.find(name).function() for name in ("one", "two")] == ["one", "two"]


def test_a_problem_file_may_import_its_neighbours(project):
    project.write("plants/other/data.py", "VALUE = 7\n")
    text = '@problem("seven")\ndef f():\n    return VALUE\n'
    project.write("plants/other/problems.py", f"{HEAD}from .data import VALUE\n{text}")
    assert registry(project).find("seven").function() == 7


@pytest.mark.parametrize(
    ("file", "folder"), [("plants/own/deep/p.py", "plants/own"), ("plants/p.py", "plants")]
)
def test_the_folder_of_a_plant_is_the_one_below_the_root(project, file, folder):
    project.write(file, f'{HEAD}@problem("deep")\ndef f(): ...\n')
    assert registry(project).find("deep").folder == project.root / folder


class Plain:
    """What nobody can write as JSON."""


@pytest.mark.cases(0)
@each("hint", ["", ": list", ": dict", ": Any"])
@each(
    "value",
    [
        math.nan,
        math.inf,
        b"x",
        b"\xff",
        {1: 1},
        {None: 1},
        [math.nan],
        {"a": math.inf},
        "\ud800",
        np.arange(3),
        Plain(),
        1j,
    ],
    ids=lambda value: "plain" if isinstance(value, Plain) else ascii(value),
)
def test_a_value_that_json_does_not_bring_back_is_refused_by_name(problem, hint, value):
    """None, nan, inf and -inf were one question, so were b"x" and "x"."""
    one = problem(f'from typing import Any\n@problem("a")\ndef f(p{hint} = None): ...')
    with pytest.raises(InputError, match=r"a: p="):
        one.to_json(one.bind({"p": value}))


@pytest.mark.parametrize(
    ("hint", "value"),
    [
        ("", 1),
        ("", 1.5),
        ("", True),
        ("", "x"),
        ("", None),
        ("", [1, "a", None, {"b": 2.0}]),
        ("", np.float32(0.1)),
        ("", np.int64(3)),
        (": float", math.inf),
        (": float", math.nan),
        (": float", 1),
        (": float | None", None),
        (": tuple[float, ...]", (1.0, math.inf)),
        (": dict[int, float]", {1: 2.0}),
        (": bytes", b"x"),
    ],
)
def test_a_value_that_json_brings_back_asks_a_question(problem, hint, value):
    one = problem(f'@problem("a")\ndef f(p{hint}): ...')
    found = one.to_json(one.bind({"p": value}))
    assert canonical(found)
    assert found.keys() == {"p"}
