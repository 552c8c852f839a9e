"""Lower bounds of mixed mu, each with a perturbation that proves it.

det(I - N Delta) = 0 proves mu(N) >= 1 / size(Delta). The Delta is found by ascent from many starts
and made exactly singular in ball arithmetic.
"""
