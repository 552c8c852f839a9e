"""Mixed H2/H-infinity synthesis: the least H2 norm under a limit of an H-infinity norm."""
