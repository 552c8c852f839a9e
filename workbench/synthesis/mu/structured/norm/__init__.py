"""The H-infinity norm as a function of a controller's parameters, and methods that minimise it."""
