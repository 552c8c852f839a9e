"""Tests of a record before anything is estimated from it: assumptions, results, findings."""
