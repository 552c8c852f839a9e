"""Covers of several orders: the trade-off between size and states."""
