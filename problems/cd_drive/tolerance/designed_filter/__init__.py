"""Strategy C with fault filters that are designed, in the loop that a defect leaves."""
