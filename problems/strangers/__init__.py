"""Twelve simulated plants that the workbench has never seen, from their loggers' files to the C
file.
"""
