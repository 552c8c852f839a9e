"""Robustness of loops: conditions, worst cases, skewed mu, branch and bound."""
