"""Modal coordinates: eigenvectors to many digits, and the enclosed realisation in these
coordinates.
"""
