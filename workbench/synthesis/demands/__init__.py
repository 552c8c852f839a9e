"""Demands on a loop in the words of its user, and the weights that express them."""
