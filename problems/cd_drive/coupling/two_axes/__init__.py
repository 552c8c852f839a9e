"""Focus and radial loop of one drive together, with the couplings between them (section 3.5)."""
