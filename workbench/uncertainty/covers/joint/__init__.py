"""Joint search for nominal and weights of a cover with the smallest sets."""
