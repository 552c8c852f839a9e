"""From residuals to decisions: residual sizes, thresholds, change detection, isolation, scores."""
