"""The content of run.json, with its types checked."""

from __future__ import annotations

import datetime
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from workbench.bench.trust.untrusted import problem_name, question_key
from workbench.errors import ResultError
from workbench.solvers import Outcome

FORMAT = 2
"""Version of the layout of a results folder."""


def _key(value: str) -> str:
    try:
        return question_key(value)
    except ResultError as error:
        raise ValueError(str(error)) from None


def _name(value: str) -> str:
    try:
        return problem_name(value)
    except ResultError as error:
        raise ValueError(str(error)) from None


def _outcome(value: str) -> str:
    return str(Outcome(value))


def _time(value: str) -> str:
    datetime.datetime.fromisoformat(value)
    return value


Key = Annotated[str, AfterValidator(_key)]
Time = Annotated[str, AfterValidator(_time)]
OutcomeName = Annotated[str, AfterValidator(_outcome)]
Seconds = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class _Information(BaseModel):
    """The entries that every run.json has."""

    model_config = ConfigDict(strict=True, extra="allow")

    format: int
    problem: Annotated[str, AfterValidator(_name)]
    parameters: dict[str, Any]
    data: dict[str, str]
    needs: dict[str, Key | list[Key]]
    method: str | None
    options: dict[str, Any]
    key: Key
    kind: str
    headline: str
    claim: OutcomeName
    outcome: OutcomeName
    message: str
    started: Time
    finished: Time
    seconds: dict[str, Seconds]
    code: str
    versions: dict[str, str]


def run_information(content: Any, folder: str) -> dict[str, Any]:
    """The content of run.json, unchanged, once it is checked to have the form of every run.

    Raises
    ------
    It has another form; or a newer workbench wrote it in another format.
        It is not; or a newer workbench wrote it in another format.
    """
    version = content.get("format") if isinstance(content, dict) else None
    if isinstance(version, int) and version > FORMAT:
        raise ResultError(
            f"{folder} has format {version}, of a newer workbench; this one reads up to {FORMAT}"
        )
    try:
        _Information.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "its content"
        raise ResultError(f"run.json of {folder}: {ascii(place)[1:-1]}: {first['msg']}") from None
    if "total" not in content["seconds"]:
        raise ResultError(f"run.json of {folder}: seconds: there is no total")
    found: dict[str, Any] = content
    return found
