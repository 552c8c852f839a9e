"""Responses of plants: given or measured, with confidence regions, or extrapolated to further
plants.
"""
