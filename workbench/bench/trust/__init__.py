"""Checks on a results folder made by somebody else: what is accepted, and what is refused."""
