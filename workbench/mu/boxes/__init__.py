"""Branch and bound over real parameters and frequency together."""
