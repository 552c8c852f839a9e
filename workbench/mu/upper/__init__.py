"""Upper bounds of mixed mu, each with the multipliers that prove it.

N* D N + j (G N - N* G) < beta^2 D for some D > 0 and G that commute with the structure proves mu(N)
< beta (Fan, Tits and Doyle, 1991). The least beta is a convex problem.
"""
