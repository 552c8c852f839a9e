"""Demands as people say them, and the weights of the loop that they become."""
