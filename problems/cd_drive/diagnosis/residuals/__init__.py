"""Detection of defects by residuals, over depth, length and noise."""
