"""Frequency responses with confidence regions for the true response."""
