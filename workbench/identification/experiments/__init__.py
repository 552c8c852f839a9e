"""Excitation, records, and whether they are fit for identification."""
