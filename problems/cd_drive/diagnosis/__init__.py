"""Surface defects: found, told apart, estimated."""
