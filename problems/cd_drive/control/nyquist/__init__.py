"""Uncertainty sets of the open loop, and the critical point -1."""
