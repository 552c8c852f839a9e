"""The focus is searched for by a ramp, and the loop closed where the error crosses zero."""
