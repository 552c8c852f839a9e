"""The first study of a user's own plants, written from the records."""

from workbench.starter.first_choices import FirstChoices, first_choices
from workbench.starter.study_folder import write_study

__all__ = ["FirstChoices", "first_choices", "write_study"]
