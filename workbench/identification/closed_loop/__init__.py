"""Models of plants whose records come from a closed loop, with what each method assumes of it."""
