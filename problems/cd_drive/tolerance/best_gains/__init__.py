"""The best gain of every strategy, and the gain in performance by a second controller."""
