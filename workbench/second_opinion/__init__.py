"""Checks of the kernel: the same claims, tried again by other mathematics, in plain NumPy.

The kernel, `workbench.certify`, proves; this room refutes. It draws plants, perturbations and
switchings that a claim covers, and checks whether one of them contradicts it. So each of its checks
fails only if something is wrong. It imports no system code, no kernel and no method: a system is
its four matrices A, B, C, D. Every draw comes from a fixed seed, so that `verify` sees the same.

Takes: a claim, and the data that it is about.
Gives: checks that a contradiction breaks.
Rests on: one counterexample refutes a claim for all.
"""

SEED = 20031121
"""Seed of every draw, so that a certificate is the same whenever it is made again."""
