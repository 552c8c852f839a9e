"""Controller and fault filter designed together, and one after the other (section 7.1.5)."""
