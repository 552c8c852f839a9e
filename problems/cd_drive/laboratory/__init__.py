"""The drive on a simulated laboratory bench, and the values that experiments on it identify."""
