"""State-space models of a record: one for prediction and one for simulation."""
