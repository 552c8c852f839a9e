"""The controller of a running loop is changed, with a step of its command and without."""
