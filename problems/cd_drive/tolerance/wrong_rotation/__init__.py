"""Strategies that need the disc's rotation frequency, with a wrong value of it (section 8.7)."""
