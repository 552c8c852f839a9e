"""The robust fault filter: what it estimates of a defect, what leaks in."""
