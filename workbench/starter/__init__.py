"""The first study of a user's own plants, generated from measured records."""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.starter.first_choices import FirstChoices, first_choices
from workbench.starter.study_folder import write_study

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = ["FirstChoices", "first_choices", "write_study"]
