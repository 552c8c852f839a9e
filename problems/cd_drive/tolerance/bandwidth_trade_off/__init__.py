"""Cost and benefit of bandwidth on a disc that deviates and is scratched (figure 6.7)."""
