"""Plants with faults, and which of the faults can be detected and told apart."""
