"""Robust performance of the reference controller under three models."""
