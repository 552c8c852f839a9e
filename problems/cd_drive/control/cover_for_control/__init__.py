"""Stadiums and controller, chosen together for the least mu."""
