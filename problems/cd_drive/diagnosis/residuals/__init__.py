"""How shallow, short and noisy a defect may be to be found."""
