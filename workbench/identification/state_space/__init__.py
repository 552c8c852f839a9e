"""State-space models of a record, one to predict and one to simulate it."""
