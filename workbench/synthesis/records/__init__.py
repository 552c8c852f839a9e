"""Feedback from records of states and inputs, for every plant that the records allow."""
