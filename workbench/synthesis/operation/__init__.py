"""The loop in operation: a controller's code about its working point, on each measured plant."""
