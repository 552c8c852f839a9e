"""Public records on which our models are judged beside those of other packages."""
