"""Automatic gain control of the drives, by a sinusoidal test signal (wobble) at crossover."""
