"""Unlike arms: several parasitic resonances, and fits of models whose order is too low."""
