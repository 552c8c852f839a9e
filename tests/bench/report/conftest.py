"""Results folders to report, written by hand, and figures for them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from html_page import Make

from workbench.bench.formats import netcdf
from workbench.bench.results import Run
from workbench.bench.store import seal
from workbench.study import Study

METHODS = [f"method-{letter}" for letter in "abcdefghij"]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "results"


@pytest.fixture
def make(root: Path) -> Make:
    """Writes a results folder."""

    def write(problem: str = "lab/circle", key: str = "0a1b2c3d", **info: Any) -> Path:
        failed, data = info.pop("failed", False), info.pop("dataset", None)
        value, metrics = info.pop("value", 0.0), info.pop("metrics", {"radius": 315.28555396})
        folder = root / problem.replace("<", "(") / (key + ".failed" if failed else key)
        folder.mkdir(parents=True)
        content = {
            "format": 2,
            "problem": problem,
            "parameters": {"frequencies": 400, "angle": None},
            "data": {"data/drives.csv": "c" * 64},
            "needs": {},
            "method": "exact",
            "options": {"tolerance": 1e-06, "time_limit": None, "seed": 0},
            "key": key,
            "kind": "program",
            "headline": "radius",
            "claim": "solved",
            "outcome": "failed" if failed else "solved",
            "message": "",
            "started": "2026-01-02T03:04:05+00:00",
            "finished": "2026-01-02T03:04:06+00:00",
            "seconds": {"statement": 0.0, "solve": 0.25, "check": 0.5, "total": 1.5},
            "code": "07f22203e4ca2a17",
            "versions": {"workbench": "0.1.0", "numpy": "2.4.6"},
            "platform": "Linux x86_64",
        } | info
        check = {"name": "containment", "statement": "distance of a point beyond its circle"}
        check |= {"value": value, "limit": 1e-09, "where": "at 5 Hz", "holds": not failed}
        gap = {"statement": "radius above its bound", "value": 2e-8, "tolerance": 1e-6}
        certificate = {"checks": [check], "gap": gap | {"required": True, "closed": True}}
        for name, stored in ("run", content), ("certificate", certificate), ("metrics", metrics):
            (folder / f"{name}.json").write_text(json.dumps(stored), encoding="utf-8")
        (folder / "log.txt").write_text("outcome: solved.\n", encoding="utf-8")
        if data is not None:
            netcdf.write(data, folder / "data.nc")
        seal(folder)
        return folder

    return write


def cells(methods: list[str], problems: int = 3) -> xr.Dataset:
    """Cells of a comparison: the second method is wrong once, the third is unfit for a problem."""
    dims = ("problem", "by_method", "accuracy", "repetition")
    shape = (problems, len(methods), 3, 1)
    place = np.indices(shape)
    verdict = np.full(shape, "solved", dtype="<U16")
    verdict[0, 1:2, 2, 0] = "wrong"
    verdict[1:2, 2:3] = "unfit"
    gap = 10.0 ** -(2.0 + 3.0 * place[2] + 0.1 * place[1])
    gap[verdict != "solved"] = np.nan
    seconds = 0.01 * (1.0 + place[0] + place[1] + place[2])
    values = {"verdict": verdict, "outcome": verdict, "gap": gap, "statement": seconds / 10}
    values |= {"solve": seconds, "certified": (verdict == "solved").astype("int8")}
    return xr.Dataset(
        {name: (dims, value) for name, value in values.items()},
        coords={
            "problem": [f"lab/{number}" for number in range(problems)],
            "by_method": methods,
            "accuracy": ["low", "middle", "high"],
            "repetition": [0],
        },
    )


@pytest.fixture
def cells_of() -> Callable[..., xr.Dataset]:
    return cells


@pytest.fixture
def make_comparison(make: Make) -> Make:
    """Writes the results folder of a comparison, of ten methods where nothing else is said."""

    def write(key: str = "0000c0de", methods: list[str] = METHODS, **info: Any) -> Path:
        asked = {"pattern": "lab/*", "problems": ["lab/0", "lab/1", "lab/2"], "methods": methods}
        asked |= {"accuracies": ["low", "middle", "high"], "parameters": {}}
        metrics = {"certified_share": 86 / 87, "false_claims": 1.0, "cells": 87.0}
        given: dict[str, Any] = {"parameters": asked, "metrics": metrics, "method": None}
        given |= {"kind": "study", "headline": "certified_share", "dataset": cells(methods)}
        return make("compare", key, **(given | info))

    return write


class Drawn(Study):
    """Draws figures by name; an error in place of a figure is raised."""

    def __init__(self, **drawn: Any) -> None:
        self.drawn = drawn

    def drawings(self, answer: Any) -> dict[str, Callable[[], dict[str, Any]]]:
        return {name: partial(self._draw, name) for name in self.drawn}

    def _draw(self, name: str) -> dict[str, Any]:
        if isinstance(self.drawn[name], Exception):
            raise self.drawn[name]
        return {name: self.drawn[name]}


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lets every run have these figures and tables."""

    def let(tables: dict[str, str] | None = None, **drawn: Any) -> None:
        monkeypatch.setattr(Run, "task", Drawn(**drawn))
        monkeypatch.setattr(Run, "answer", None)
        monkeypatch.setattr(Run, "tables", tables or {})

    return let
