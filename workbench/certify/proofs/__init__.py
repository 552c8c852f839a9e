"""Proofs of peaks: what is kept of a search so that it can be checked again, and its storage."""
