"""Continuous-time transfer functions from sampled records."""
