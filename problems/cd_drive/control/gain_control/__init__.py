"""Automatic gain control of the drives, by a wobble at crossover."""
