"""All controllers at 1X, compared by the same certified analysis."""
