"""The smallest sets of matrices Z + W_1 Delta W_2 at each frequency."""
