"""Sensitivity and margins of the reference controller on twelve drives."""
