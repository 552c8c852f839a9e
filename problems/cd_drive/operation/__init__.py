"""How a loop is closed, jumps tracks, changes its controller, and is closed again when lost."""
