"""Responses of plants: given, measured, with confidence regions, extrapolated to further plants."""
