"""Methods that lower mixed mu, or a norm, directly over the parameters of a controller of fixed
structure.
"""
