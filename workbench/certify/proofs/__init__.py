"""Proofs of peaks: the result of a search, kept so that it can be checked again, and its
storage.
"""
