"""What a loop tells of its plant beyond a linear model of it: distortion, and dynamics.

Methods that use the explained part of the input have no model of the noise, and feedback makes the
measured input depend on it. So the loop is opened: the input of the opened record is the explained
part of the measured one. Its output is the model's response to that, plus the plant's own noise:
what y differs from the model's response to the measured input. An autoregression of the noise makes
the errors white, and they are tested as those of an open loop (`innovations.distortion`).

Source: P. Van den Hof, R. Schrama, "An indirect method for transfer function estimation from closed
loop data", Automatica 29(6), 1993 (the explained input as that of an open loop).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.autoregression import chosen_autoregression
from workbench.identification.innovations.criterion import Criterion, all_but_gain
from workbench.identification.innovations.distortion import Distortion, distortion_of_errors
from workbench.identification.innovations.model import InnovationsModel


def distortion_in_loop(
    model: InnovationsModel,
    record: Experiments,
    explained_input: RealArray,
    direct: bool,
    washout: int,
    repeats: int | None,
) -> Distortion | None:
    """What a record of a loop tells beyond a plant's model, by the explained part (N, nu) of u.

    None for a model that is not stable, since its free run is not bounded, and for a record that is
    too short or too long for the test. ``direct``: whether D is free; ``washout``: the number of
    samples from which initial states are estimated; ``repeats``: the period of the excitation
    [samples], None: it has none.
    """
    if model.radius >= 1:
        return None
    plant = replace(model, K=np.zeros_like(model.K))
    noise = record.y - plant.free_run(record.u, record.y, washout)
    driven = plant.free_run(explained_input, record.y, washout)
    opened = replace(record, u=explained_input, y=driven + noise)
    filters = [np.append(1.0, -chosen_autoregression(v)) for v in noise.T]
    criterion = Criterion(plant, opened, 0.0, direct, all_but_gain(plant))
    theta = criterion.start(plant)
    return distortion_of_errors(criterion, theta, np.eye(len(theta)), opened, repeats, filters)
