"""(D, G)-K iteration: multipliers are fitted so that they prove the least bound for the loop."""
