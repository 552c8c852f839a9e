"""What raises the sum of the diodes: white dots, and tracks that are jumped."""
