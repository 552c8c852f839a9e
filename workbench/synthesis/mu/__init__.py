"""Mu synthesis: D-K, (mu, D)-K and (D, G)-K iteration, and fixed structures."""
