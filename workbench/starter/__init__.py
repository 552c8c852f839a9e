"""The first study of a user's own plants, generated from measured records.

Takes: files of records, demands on the loop, and limits of the input.
Gives: a folder with a plant, weights, a cover, a controller, C code and simulated loops.
Rests on: the certificates of the rooms that it calls; its first choices are only proposals.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.starter.channel_study import ChannelChoices, write_channel_study
from workbench.starter.first_choices import FirstChoices, first_choices
from workbench.starter.study_folder import write_study

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "ChannelChoices",
    "FirstChoices",
    "first_choices",
    "write_channel_study",
    "write_study",
]
