"""Margins of loops, computed a second way: turns about 0, chords between data, redrawn data."""
