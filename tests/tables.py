"""A law over many items as one test, whose failure is a table of all that break it."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import pytest

Law = Callable[..., None]
WIDEST = 160
"""Characters of a row of the table."""


def hold(law: Law, cases: Mapping[str, Mapping[str, Any]]) -> None:
    """Try a law on arguments by the name of the case; fail with a table of the cases that break it.

    The first of them is the cause of the failure, so that its traceback is shown.
    """
    assert cases, "a law over nothing"
    broken: dict[str, BaseException] = {}
    for name, arguments in cases.items():
        try:
            law(**arguments)
        except (Exception, pytest.fail.Exception) as error:
            broken[name] = error
    if broken:
        width = max(map(len, broken))
        rows = [f"{name:{width}}  {_said(error)}"[:WIDEST] for name, error in broken.items()]
        table = "\n".join([f"{len(broken)} of {len(cases)} break it", *rows])
        raise AssertionError(table) from next(iter(broken.values()))


def each(
    names: str | Sequence[str],
    values: Iterable[Any],
    *,
    ids: Iterable[str] | Callable[[Any], str] = repr,
) -> Callable[[Law], Law]:
    """One test of all values, where `pytest.mark.parametrize` makes one of each.

    For quick laws that leave nothing behind: the values share their fixtures.
    """
    given = list(values)
    titles = [ids(value) for value in given] if callable(ids) else list(ids)
    single = isinstance(names, str)
    asked = (names,) if isinstance(names, str) else tuple(names)
    cases = {
        f"{number} {title}": dict(zip(asked, (value,) if single else value, strict=True))
        for number, (title, value) in enumerate(zip(titles, given, strict=True))
    }

    def decorate(law: Law) -> Law:
        def test(**fixtures: Any) -> None:
            hold(law, {name: case | fixtures for name, case in cases.items()})

        signature = inspect.signature(law)
        shared = [one for one in signature.parameters.values() if one.name not in asked]
        test.__signature__ = signature.replace(parameters=shared)  # type: ignore[attr-defined]
        test.__name__, test.__doc__, test.__module__ = law.__name__, law.__doc__, law.__module__
        return test

    return decorate


def _said(error: BaseException) -> str:
    """What an error says, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
