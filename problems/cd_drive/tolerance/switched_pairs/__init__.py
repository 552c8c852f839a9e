"""The best pair of a fast and a slow controller against the best single controller."""
