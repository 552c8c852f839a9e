"""The command line. Exit status 0: every certificate holds; 1: one does not; 2: an error.

Takes: the words of a command.
Gives: lines on the terminal, or JSON; folders of results and pages.
Rests on: `workbench.api` and the bench, which do the work; no theorem is needed.
"""

# Where to look:
#   group                 the group of commands, and options that several commands have
#   catalogue             list, show, cite, results
#   starting              init, notebooks, doctor
#   running, comparing    run, sweep, compare
#   folders               verify, draw, report

from workbench.cli import catalogue, comparing, folders, running, starting
from workbench.cli.group import main

__all__ = ["catalogue", "comparing", "folders", "main", "running", "starting"]
