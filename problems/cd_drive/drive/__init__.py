"""The drive and the disc: printed tables, actuator, optics and responses."""
