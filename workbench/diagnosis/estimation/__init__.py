"""Fault estimation as a Program: filters that estimate faults on every plant of a set."""
