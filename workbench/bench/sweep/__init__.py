"""A sweep: one problem over a grid of its parameters, as labelled arrays, tables and a figure."""

from workbench.bench.sweep.dataset import SWEEP, SweptPoint, sweep_dataset
from workbench.bench.sweep.study import ParameterSweep

__all__ = ["SWEEP", "ParameterSweep", "SweptPoint", "sweep_dataset"]
