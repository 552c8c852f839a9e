"""Sets of plants that contain the twelve drives."""
