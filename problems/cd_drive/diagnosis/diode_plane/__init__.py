"""Surface defects in the plane of the two diodes."""
