"""Controller and fault filter designed in one, and one after the other (section 7.1.5)."""
