"""The best gain of every strategy, and what a second controller gains."""
