"""Order reduction of controllers: balanced truncation, optimal Hankel norm approximation, and
truncation weighted by the closed loop.
"""
