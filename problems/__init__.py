"""The plants and the named problems: one folder a plant."""
