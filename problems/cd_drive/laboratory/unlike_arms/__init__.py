"""Arms that are unlike: several parasitic resonances, and fits of a model of too low an order."""
