"""Mixed H2/H-infinity synthesis: the least H2 norm under a limit on an H-infinity norm."""
