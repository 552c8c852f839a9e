"""Bounds on robust performance that hold for every stabilising controller."""
