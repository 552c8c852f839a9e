"""A fast and a slow controller, switched by the quality signal."""
