"""Estimators of positions and periodic disturbances, sample by sample."""
