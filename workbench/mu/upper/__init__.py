"""Upper bounds of mixed mu, each with the multipliers that prove it."""
