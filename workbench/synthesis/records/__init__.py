"""Feedback from records of states and inputs, for every plant that agrees with the records.

The matrix S-lemma (van Waarde, Camlibel and Mesbahi, 2022) turns a bound on the noise into one
linear matrix inequality.
"""
