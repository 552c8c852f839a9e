"""Models in innovations form: recursions, prediction errors, and estimation from these."""
