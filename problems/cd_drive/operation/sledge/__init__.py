"""The sledge that carries the pickup, and its jerks (section 2.5.2)."""
