"""Strategies that hold the loop while a defect passes, and their performance."""
