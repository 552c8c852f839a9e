"""State feedback from the estimates of strategy B, in place of its controller and switch."""
