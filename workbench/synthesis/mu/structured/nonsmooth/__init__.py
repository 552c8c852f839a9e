"""Local minimisation of functions with kinks that are infinite outside a set, and how far from a
stationary point it ends."""
