"""Proofs that no controller of a kind stabilises a plant."""
