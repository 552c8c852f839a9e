"""The H-infinity norm over the parameters of a controller, and the methods that lower it."""
