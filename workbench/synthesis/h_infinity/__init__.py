"""H-infinity synthesis, mixed sensitivity and loop shaping."""
