"""An algebra of uncertain systems."""
