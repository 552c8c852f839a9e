"""Test whether the loop is open: whether the past of the outputs predicts the inputs."""
