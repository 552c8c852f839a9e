"""What bandwidth costs and gains where a disc deviates and is scratched (figure 6.7)."""
