"""The radial loop is opened, the lens kicked across tracks and braked, and the loop closed on
another track.
"""
