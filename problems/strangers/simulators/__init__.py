"""Nonlinear plants in plain NumPy: nothing of the workbench is known here."""
