"""The plants and problems that come with the workbench, under one import path.

`workbench.plants.cd_drive` is the folder `problems/cd_drive`: in a checkout this package points
there, and in a wheel `problems` is packed in its place.
"""

from pathlib import Path

__path__ = [str(Path(__file__).parents[2] / "problems")]
