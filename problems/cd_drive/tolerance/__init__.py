"""Strategies that keep the loop while a defect passes, and how well they do."""
