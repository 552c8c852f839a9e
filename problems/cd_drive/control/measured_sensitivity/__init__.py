"""Sensitivity measured in the laboratory, compared with the simulated one."""
