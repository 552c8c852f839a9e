"""Conversion of identified state-space models to labelled datasets, and back."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count, takewhile
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Dataset
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.candidates import Candidates
from workbench.identification.state_space.identified import MODELS, USES, IdentifiedModels
from workbench.identification.state_space.question import RecordedQuestion

MATRICES = {
    "A": ("{}_state", "{}_state_"), "B": ("{}_state", "input"), "C": ("output", "{}_state"),
    "D": ("output", "input"), "K": ("{}_state", "output"),
    "u_offset": ("input",), "y_offset": ("output",),
}  # fmt: skip
"""Matrices of a model, each with its dimensions in a dataset."""
FREQUENCIES = 200
"""Number of frequencies of the response, if the record has none of its own."""


def to_dataset(program: RecordedQuestion, answer: IdentifiedModels) -> Dataset:
    """The models, their runs on the held-out samples, responses and residual tests."""
    import xarray as xr

    record, rest = program.record, program.judged_record
    estimate = program.nonparametric
    frequency = (
        np.linspace(0, 0.5, FREQUENCIES + 2)[1:-1]
        if estimate is None
        else estimate.cycles_per_sample
    )
    grid, held = ("frequency", "output", "input"), ("time", "output")
    own, crossed = program.residual_tests(answer.predictor)
    lags, deviations = len(own), {"units": "standard deviations"}
    models = {
        name: model for of in MODELS for name, model in _with_members(of, getattr(answer, of))
    }
    names = [f"{name}_{matrix}" for name in models for matrix in MATRICES]
    matrices = {
        f"{name}_{matrix}": (tuple(dim.format(name) for dim in dims), getattr(model, matrix))
        for name, model in models.items()
        for matrix, dims in MATRICES.items()
    }
    nonparametric: dict[str, tuple[tuple[str, ...], RealArray | ComplexArray, dict[str, str]]] = {}
    if estimate is not None:
        nonparametric = {
            "nonparametric": (grid, estimate.response, {}),
            "variance": (grid, estimate.variance, {"long_name": "of nonparametric"}),
        }
    choice, extra = answer.candidates, {}
    if choice is not None:
        points, places = {"units": "%"}, ("use", "candidate")
        extra = {
            "candidate_fit": (places, choice.fits, points),
            "candidate_lost": (places, choice.lost, points),
            "candidate_deviation": (places, choice.deviation, points),
            "candidate": ("candidate", list(choice.labels)),
        }
        if choice.averaged is not None:
            extra["fit_of_average"] = ("use", choice.averaged, points)
    return xr.Dataset(
        {
            **extra,
            **{name: matrices[name] for name in names},
            **{f"{name}_resting": model.resting for name, model in models.items() if model.resting},
            "validation_fit": (("use", "order", "output"), answer.scores, {"units": "%"}),
            "measured": (held, rest.y, {"long_name": "held-out record"}),
            "one_step": (held, _whole_run(answer.predictor, "one_step", program)),
            "free_run": (held, _whole_run(answer.simulator, "free_run", program)),
            "response": (
                grid, answer.simulator.response(frequency), {"long_name": "of the simulator"},
            ),
            **nonparametric,
            "autocorrelation": (("lag", "output"), own, deviations),
            "cross_correlation": (("shift", "output", "input"), crossed, deviations),
        },
        coords={
            "input": list(record.inputs),
            "output": list(record.outputs),
            "order": list(program.orders or ()),
            "use": list(USES),
            "time": (
                "time",
                np.arange(program.estimation_samples, len(record)),
                {"units": "samples"},
            ),
            "frequency": ("frequency", frequency, {"units": "cycles/sample"}),
            "lag": ("lag", np.arange(1, lags + 1), {"units": "samples"}),
            "shift": ("shift", np.arange(-lags, lags + 1), {"units": "samples"}),
        },
        attrs={"washout": program.washout_samples},
    )  # fmt: skip


def _with_members(name: str, model: InnovationsModel) -> Iterator[tuple[str, InnovationsModel]]:
    """A model under its name, and the models that it averages under numbered names."""
    yield name, model
    for number, member in enumerate(model.members, 1):
        yield f"{name}_{number}", member


def _whole_run(model: InnovationsModel, use: str, program: RecordedQuestion) -> RealArray:
    """A run of a model over all held-out experiments (N, ny)."""
    run = getattr(model, use)
    return np.vstack(
        [run(u, y, program.washout_samples) for u, y in program.judged_record.pieces()]
    )


def stored_candidates(data: Dataset) -> Candidates | None:
    """The candidates of a choice; None if the dataset has none."""
    if "candidate" not in data.dims:
        return None
    return Candidates(
        tuple(str(label) for label in data["candidate"].values),
        data["candidate_fit"].values,
        data["candidate_lost"].values,
        data["candidate_deviation"].values,
        data["fit_of_average"].values if "fit_of_average" in data else None,
    )


def innovations_model_of(program: RecordedQuestion, data: Dataset, name: str) -> InnovationsModel:
    """The model with this name in a dataset, with the record's channel names and sampling time."""
    record, numbers, resting = program.record, count(1), f"{name}_resting"
    stored = takewhile(lambda one: f"{one}_A" in data, (f"{name}_{k}" for k in numbers))
    matrices: dict[str, Any] = {one: data[f"{name}_{one}"].values for one in MATRICES}
    return InnovationsModel(
        **matrices,
        delay_samples=program.delays_samples,
        **record.labels,
        members=tuple(innovations_model_of(program, data, one) for one in stored),
        resting=int(data[resting]) if resting in data else 0,
    )
