"""Margins of loops a second way: turns about 0, chords between data, data drawn anew."""
