"""Loops of one channel in exact arithmetic: crossings, dead time as it is, least distances."""
