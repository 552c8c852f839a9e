"""Uncertainty sets on the open loop, and the point -1."""
