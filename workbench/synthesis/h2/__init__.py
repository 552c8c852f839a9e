"""H2 synthesis: the least mean square of the performance under white noise; LQG."""
