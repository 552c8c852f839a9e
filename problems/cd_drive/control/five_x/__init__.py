"""Robust performance at five times the nominal speed of the disc."""
