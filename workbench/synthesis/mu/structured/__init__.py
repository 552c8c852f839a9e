"""Controllers of fixed structure that lower mixed mu directly."""
