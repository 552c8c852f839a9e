"""Nonlinear plants in plain NumPy, which use nothing of the workbench."""
