"""A ramp searches for the focus, and the loop is closed where the error crosses zero."""
