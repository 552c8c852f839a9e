"""Linear time-invariant systems: what every room needs of them."""
