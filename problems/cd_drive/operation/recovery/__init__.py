"""A loop is lost, the loss is noticed, and the data come back."""
