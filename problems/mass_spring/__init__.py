"""Two masses and an uncertain spring, a benchmark of mixed mu."""
