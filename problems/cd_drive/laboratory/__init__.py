"""The drive on a virtual bench, and what experiments on it identify."""
