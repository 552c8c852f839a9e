"""The loop in operation: a controller's code around its working point, on each measured plant."""
