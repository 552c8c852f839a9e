"""What the thesis says, item by item, and what became of it."""
