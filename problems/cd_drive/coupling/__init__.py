"""Both positioning loops of a drive together: what couples them, and the sums of their diodes."""
