"""Modal coordinates: eigenvectors to many digits, and the realisation enclosed in them."""
