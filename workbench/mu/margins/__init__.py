"""Margins of loops: classical ones, disks, and both over a set of plants."""
