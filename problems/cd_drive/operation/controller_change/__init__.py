"""The controller of a running loop is changed, with its step and without."""
