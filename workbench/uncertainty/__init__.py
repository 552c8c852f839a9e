"""Uncertainty models: covers of response sets, parametric models, generalised plants."""
