"""Strategies that have to know the disc's rotation, and are told a wrong one (section 8.7)."""
