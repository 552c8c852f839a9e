"""Models that are estimated sample by sample, for plants that change."""
