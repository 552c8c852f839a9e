"""H-infinity synthesis, mixed sensitivity and loop shaping.

Two Riccati equations (Doyle, Glover, Khargonekar and Francis, 1989), SLICOT, or the linear matrix
inequalities of Gahinet and Apkarian (1994). Singular plants are perturbed, and the answer is
certified on the plant as given.
"""
