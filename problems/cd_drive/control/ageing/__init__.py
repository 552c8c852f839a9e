"""A suspension that ages: one controller for its whole life, or one for the values found at each
start.
"""
