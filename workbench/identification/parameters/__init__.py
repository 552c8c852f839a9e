"""Physical parameters fitted to measured responses and records."""
