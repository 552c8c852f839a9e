"""Bounds of mu over frequency, and the peak over all frequencies."""
