"""Models that are updated sample by sample, for plants that change."""
