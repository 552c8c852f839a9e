"""The four groups of disturbances of a positioning loop, self-pollution among them."""
