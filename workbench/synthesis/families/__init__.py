"""Families of controllers with a fixed structure and few real parameters."""
