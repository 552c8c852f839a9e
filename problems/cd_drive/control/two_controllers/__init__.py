"""One controller for disturbances and one for surface defects."""
