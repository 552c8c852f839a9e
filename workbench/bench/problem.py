"""A named problem, imported: it checks parameters, resolves needs and makes the task."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import json
import sys
import traceback
import types
import typing
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import workbench
import workbench.plants
from workbench.bench.code import file_of, helper_modules
from workbench.bench.declare import PLACEMENT, RESERVED_PARAMETERS, Fed, Needs, Ref, Settings
from workbench.bench.discovery import AxisFunction, Entry
from workbench.bench.question import canonical, is_same
from workbench.errors import InputError, RegistryError, UnknownNameError, WorkbenchError

if TYPE_CHECKING:
    from workbench.program import Task


class Problem:
    """A registered function, imported: its parameters, needs and data files."""

    def __init__(self, entry: Entry) -> None:
        self.entry = entry
        self.name = entry.name
        self.function = getattr(import_file(entry.root, entry.file), entry.function)
        self.settings: Settings = getattr(self.function, PLACEMENT)
        self.signature = inspect.signature(self.function)
        missing = entry.axes.keys() - self.signature.parameters.keys()
        if missing:
            raise RegistryError(
                f"{entry.place}: the function takes no parameter for axis {', '.join(missing)}"
            )

        taken = RESERVED_PARAMETERS & self.parameters.keys()
        if taken:
            raise RegistryError(
                f"{entry.place}: a parameter may not be called {', '.join(sorted(taken))}, as an "
                "argument of workbench.run or workbench.compare is"
            )

        for name in self.settings.added:
            if name not in self.defaults:
                raise RegistryError(
                    f"{entry.place}: added={name!r}; a parameter with a default is needed"
                )

    @cached_property
    def parameters(self) -> dict[str, inspect.Parameter]:
        """The parameters that a user may set: all except axes of the name and needs."""
        fixed = set(self.entry.axes)
        if not callable(self.settings.needs):
            fixed |= set(self.settings.needs)
        # known only when parameters are bound; before that, arguments for runs, and those without
        # type or default
        else:
            fixed |= {
                name
                for name, parameter in self.signature.parameters.items()
                if (
                    parameter.annotation is inspect.Parameter.empty
                    and parameter.default is inspect.Parameter.empty
                )
                or self._is_run(name)
            }
        return {n: p for n, p in self.signature.parameters.items() if n not in fixed}

    @property
    def defaults(self) -> dict[str, Any]:
        """Default values of the parameters."""
        empty = inspect.Parameter.empty
        return {n: p.default for n, p in self.parameters.items() if p.default is not empty}

    @property
    def folder(self) -> Path:
        """The plant's folder; paths of data files are relative to it."""
        return self.entry.folder

    def bind(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters checked and converted, with defaults and axes filled in.

        Raises
        ------
        UnknownNameError, InputError
            An unknown parameter; or a missing or unsuitable value; the message names it.
        """
        for name in given:
            if name not in self.parameters:
                raise UnknownNameError(f"parameter of {self.name}", name, self.parameters)
        bound: dict[str, Any] = dict(self.entry.axes)
        for name, parameter in self.parameters.items():
            if name in given:
                bound[name] = self._convert(name, given[name])
            elif parameter.default is not inspect.Parameter.empty:
                bound[name] = parameter.default
            elif not callable(self.settings.needs):  # a need may still supply it
                raise InputError(f"{self.name} needs a value for {name}")
        return bound

    def needs(self, bound: Mapping[str, Any]) -> Needs:
        """References to the results that the problem needs.

        Raises
        ------
        RegistryError
            They name an argument that the function does not have, or an unknown axis.
        InputError
            A parameter has no value, and no need supplies one.
        """
        needs = self.settings.needs
        if callable(needs):
            try:
                needs = needs(**bound)
            except Exception as error:
                raise RegistryError(
                    f"{self.entry.place}: its needs cannot be told: {place_of(error)}"
                ) from error
        _check_needs(needs, self.entry)
        taken = self.signature.parameters
        strangers = needs.keys() - taken.keys()
        if strangers:
            raise RegistryError(
                f"{self.entry.place} takes no argument {', '.join(sorted(strangers))} to feed"
            )
        missing = {
            name
            for name in taken.keys() - bound.keys() - needs.keys()
            if taken[name].default is inspect.Parameter.empty
        }
        if missing:
            raise InputError(f"{self.name} needs a value for {', '.join(sorted(missing))}")
        return _fill(needs, self.entry)

    def task(self, bound: Mapping[str, Any], fed: Mapping[str, Any]) -> Task:
        """The Program or Study that the function makes from its parameters and needs.

        Raises
        ------
        RegistryError
            The function returns something else, or raises an error that is not the workbench's own.
        """
        from workbench.program import Task  # imports NumPy, which a list of names does without

        try:
            task = self.function(**bound, **fed)
        except WorkbenchError:
            raise
        except Exception as error:
            raise RegistryError(f"{self.entry.place} raised {place_of(error)}") from error
        if not isinstance(task, Task):
            raise RegistryError(
                f"{self.entry.place} returned {type(task).__name__}, not a Program or a Study"
            )
        return task

    def data_hashes(self) -> dict[str, str]:
        """SHA-256 of every data file that the problem declares."""
        hashes = {}
        for name in map(self._of_axes, self.settings.data):
            try:
                hashes[name] = hashlib.sha256((self.folder / name).read_bytes()).hexdigest()
            except OSError as error:
                raise InputError(
                    f"{self.name}: data file {self.folder / name} cannot be read: {error.strerror}"
                ) from None
        return hashes

    def _of_axes(self, name: str) -> str:
        """The name of a data file, with its axes filled in."""
        try:
            return name.format(**self.entry.axes)
        except (KeyError, IndexError, ValueError) as error:
            raise RegistryError(
                f"{self.entry.place}: data file {name!r} needs an axis for {error}"
            ) from None

    def to_json(self, bound: Mapping[str, Any]) -> dict[str, Any]:
        """Bound parameters as plain JSON values.

        Raises InputError for a value that does not survive JSON unchanged: two values could give
        the same question.
        """
        return {name: self._carried(name, value) for name, value in bound.items()}

    def asked(self, bound: Mapping[str, Any]) -> dict[str, Any]:
        """The plain JSON values that enter the question: all except defaults of added parameters.

        Raises InputError as `to_json`.
        """
        return {
            name: value
            for name, value in self.to_json(bound).items()
            if not (name in self.settings.added and bound[name] == self.defaults[name])
        }

    def _carried(self, name: str, value: Any) -> Any:
        """A value as plain JSON, from which it is read back unchanged."""
        from pydantic import TypeAdapter

        adapter = TypeAdapter(self.hint(name))
        try:
            kind = adapter.validate_python(value)  # 1 for 1.0, where a float is expected
            found = adapter.dump_python(value, mode="json")
            back = adapter.validate_python(json.loads(canonical(found)))
            carried = is_same(back, kind)
        except (ValueError, TypeError, RecursionError):
            carried = False
        if not carried:
            raise InputError(
                f"{self.name}: {name}={repr(value)[:200]} does not come back from JSON unchanged: "
                "other values would ask the same question; give numbers, texts, lists, or "
                "mappings by texts, and annotate the parameter (float for nan and inf)"
            )
        return found

    def _convert(self, name: str, value: Any) -> Any:
        from pydantic import TypeAdapter, ValidationError

        adapter = TypeAdapter(self.hint(name))
        if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):  # a NumPy number
            value = value.item()
        try:
            return adapter.validate_python(value)
        except ValidationError as error:
            reason = error.errors()[0]["msg"]
        if isinstance(value, str):  # from the command line: lists and mappings are written as JSON
            try:
                return adapter.validate_json(value)
            except ValidationError:
                pass
        raise InputError(f"{self.name}: {name}={value!r} does not fit: {reason}")

    def _is_run(self, name: str) -> bool:
        """Whether an argument is annotated as a run; None if nothing supplies it."""
        hint = self.hint(name)
        kinds = [kind for kind in typing.get_args(hint) or (hint,) if kind is not type(None)]
        return len(kinds) == 1 and inspect.isclass(kinds[0]) and issubclass(kinds[0], Fed)

    def hint(self, name: str) -> Any:
        """The evaluated annotation of a parameter, or of the return value."""
        return self._hints.get(name, Any)

    @property
    def kind(self) -> Any:
        """The class that the annotation says the problem returns; the first one of several.

        None where it names no class.
        """
        told = self.hint("return")
        classes = filter(inspect.isclass, typing.get_args(told) or (told,))
        return next(iter(classes), None)

    @cached_property
    def _hints(self) -> dict[str, Any]:
        try:
            return typing.get_type_hints(self.function, include_extras=True)
        except Exception as error:
            raise RegistryError(
                f"{self.entry.place}: an annotation cannot be evaluated: {error}"
            ) from None


def _check_needs(needs: Any, entry: Entry) -> None:
    """Raise RegistryError unless needs are a mapping from arguments to references."""
    if not isinstance(needs, Mapping):
        raise RegistryError(
            f"{entry.place}: needs are {type(needs).__name__}; a mapping from arguments to "
            "ref(...) is needed"
        )
    for name, value in needs.items():
        references = value if isinstance(value, list) else [value]
        if not (isinstance(name, str) and all(isinstance(one, Ref) for one in references)):
            raise RegistryError(
                f"{entry.place}: it needs {name!r}: {value!r}; a name with ref(...) is needed, or "
                "with a list of them"
            )


def _fill(needs: Needs, entry: Entry) -> Needs:
    """Fill in the axes of the problem's name in names of references."""

    def fill(reference: Ref) -> Ref:
        try:
            name = reference.name.format(**entry.axes)
        except (KeyError, IndexError) as error:
            raise RegistryError(
                f"{entry.place} needs {reference.name!r}: no axis {error}"
            ) from None
        return Ref(name, reference.method, reference.parameters)

    return {
        key: [fill(one) for one in value] if isinstance(value, list) else fill(value)
        for key, value in needs.items()
    }


def axis_values(function: AxisFunction) -> Any:
    """The values that the function of an axis returns. Raises RegistryError if it fails."""
    module = import_file(function.root, function.file)
    try:
        return getattr(module, function.name)()
    except Exception as error:
        raise RegistryError(
            f"{function.file}: {function.name}(), the values of an axis, failed: {place_of(error)}"
        ) from error


def import_file(root: Path, file: Path) -> types.ModuleType:
    """Import a problem file; if a file of its root was edited, import all of the root anew.

    The user's modules outside the root that it imports, such as helpers beside it, are treated
    alike.
    """
    package = _package(root)
    helpers = _helpers(package)
    files = [*root.rglob("*.py"), *helpers.values()]
    state = {one: one.stat().st_mtime_ns for one in files if one.is_file()}
    before = _imported.get(package)
    if before is not None:
        edited = any(before.get(one, seen) != seen for one, seen in state.items())
        edited = edited or {one for one in before if root in one.parents} != {
            one for one in state if root in one.parents
        }
    # a notebook may have imported a plant's modules itself, and the files may have been edited
    # since
    else:
        edited = max(state.values()) > workbench.IMPORT_TIME
    if edited:
        for name in [name for name in sys.modules if name.startswith(f"{package}.")]:
            del sys.modules[name]
        for name in helpers:
            sys.modules.pop(name, None)
        _outside.pop(package, None)
    parts = file.relative_to(root).with_suffix("").parts
    # Python detects outdated byte code by whole seconds only; problem files are few, so no byte
    # code is written.
    keep, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        return importlib.import_module(".".join((package, *parts)))
    except Exception as error:
        hint = _relative_hint(error, file)
        words = f"problem file {file} cannot be imported: {place_of(error)}{hint}"
        raise RegistryError(words) from error
    finally:
        sys.dont_write_bytecode = keep
        found = {one: one.stat().st_mtime_ns for one in _helpers(package).values()}
        _imported[package] = found | state


def _helpers(package: str) -> dict[str, Path]:
    """The user's modules that a package imports from outside itself, with their files."""
    modules = {name for name in sys.modules if name.startswith(f"{package}.")}
    read, found = _outside.get(package, (set(), {}))
    if not read <= modules:  # some were imported anew, and may import others now
        read, found = set(), {}
    for name in helper_modules(modules - read):
        file = file_of(name)
        if file is not None and name != "__main__":
            found[name] = file
    _outside[package] = modules, found
    return found


def helper_files() -> list[Path]:
    """The user's files outside problem folders that imported problem files use."""
    return sorted({file for package in _imported for file in _helpers(package).values()})


def _relative_hint(error: Exception, file: Path) -> str:
    """Advice for a file that imports its neighbour as if that were a top-level module."""
    name = error.name if isinstance(error, ModuleNotFoundError) else None
    if name is None or not (file.parent / f"{name}.py").exists():
        return ""
    return f"; {name}.py lies beside it: write `from .{name} import ...`"


def _package(root: Path) -> str:
    """The package of a problem folder: `workbench.plants`, or a package of its own."""
    if root == Path(workbench.plants.__path__[0]).resolve():
        return workbench.plants.__name__
    name = f"workbench_problems_{hashlib.sha256(str(root).encode()).hexdigest()[:8]}"
    if name not in sys.modules:
        module = types.ModuleType(name)
        module.__path__ = [str(root)]
        sys.modules[name] = module
    return name


_outside: dict[str, tuple[set[str], dict[str, Path]]] = {}
"""For each root: its modules whose imports were read, and the modules outside that they import."""
_imported: dict[str, dict[Path, int]] = {}
"""For each root: the modification times of its files when it was imported."""


def place_of(error: BaseException) -> str:
    """An error's type, message and line."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({last.filename}:{last.lineno})"
