"""The smallest sets of matrices W_1 Delta W_2, at each frequency."""
