"""The H-infinity norm over the parameters of a controller, and searches that lower it."""
