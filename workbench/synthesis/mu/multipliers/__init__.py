"""(D, G)-K iteration: multipliers fitted by what they do to the loop."""
