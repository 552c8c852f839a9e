"""Deviation of the plants of the parametric uncertainty from the nominal plant."""
