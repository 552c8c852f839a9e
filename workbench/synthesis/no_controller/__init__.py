"""Proofs that no controller of a certain kind stabilises a plant."""
