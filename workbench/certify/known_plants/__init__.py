"""Containment of known plants in the sets of uncertainty models, at every frequency."""
