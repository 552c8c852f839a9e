"""Two causes of a raised sum of the diodes: white dots, and track jumps."""
