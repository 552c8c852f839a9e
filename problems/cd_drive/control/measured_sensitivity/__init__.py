"""Sensitivity measured in the laboratory, beside the simulated one."""
