"""Models in innovations form: their recursions, prediction errors and what these determine."""
