"""The working point of a loop: constant signals, limits of the control, and the static errors."""
