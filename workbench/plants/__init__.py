"""The plants and problems that come with the workbench, under one import path.

Takes: nothing.
Gives: plants, data and registered problems, by name: `workbench.plants.cd_drive` and others.
Rests on: the sources that docstrings and the README files of the data name.
"""

# `workbench.plants.cd_drive` is the folder `problems/cd_drive`: in a checkout this package points
# there, and in a wheel `problems` is packed in its place.

from pathlib import Path

__path__ = [str(Path(__file__).parents[2] / "problems")]
