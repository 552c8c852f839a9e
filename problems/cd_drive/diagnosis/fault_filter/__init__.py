"""The robust fault filter: how well it estimates a defect, and how much of the disc leaks in."""
