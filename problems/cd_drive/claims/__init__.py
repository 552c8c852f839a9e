"""Statements of the thesis, item by item, with the verdict on each."""
