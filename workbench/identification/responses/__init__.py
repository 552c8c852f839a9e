"""Frequency responses with the region that holds the true one."""
