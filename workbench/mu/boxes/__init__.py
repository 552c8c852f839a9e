"""Branch and bound over real parameters and frequency together.

A box of parameters is proven stable by an upper bound of mu about its centre, or cut in two. The
margin lies between the largest proven box and the nearest unstable member.
"""
