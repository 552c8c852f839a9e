"""Runs of many problems for the command line: one after the other, or several at once."""

from workbench.cli.batch.jobs import ended, workers

__all__ = ["ended", "workers"]
