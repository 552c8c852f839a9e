"""Modal coordinates: eigenvectors of many digits, and what a realisation is in them, enclosed."""
