"""Every controller at 1X, judged by the same certified analysis."""
