"""Lower bounds of mixed mu, each with a perturbation that proves it."""
