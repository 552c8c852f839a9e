"""Public records on which our models are compared with those of other packages."""
