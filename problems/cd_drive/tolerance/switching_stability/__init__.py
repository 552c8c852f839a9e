"""Stability while controllers switch."""
