"""A map from the four diodes of a record with defects to the true errors of both loops."""
