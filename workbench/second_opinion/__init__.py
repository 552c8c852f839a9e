"""Checks that try to refute what the kernel `workbench.certify` proved, by other mathematics.

Takes: a claim, and the data that it is about.
Gives: checks that fail only if the claim is wrong.
Rests on: one counterexample refutes a claim about all plants.
"""

# This room draws plants, perturbations and switchings that a claim covers, and looks for one that
# contradicts it. It is plain NumPy: it imports no system code, no kernel and no method. A system is
# its four matrices A, B, C, D.

SEED = 20031121
"""Seed of every draw, so that a certificate is the same whenever it is made again."""
