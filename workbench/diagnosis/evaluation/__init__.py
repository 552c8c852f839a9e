"""From residuals to decisions: sizes, thresholds, change detection, isolation, scores."""
