"""Tests of a record before any estimation: assumptions, results, findings."""
