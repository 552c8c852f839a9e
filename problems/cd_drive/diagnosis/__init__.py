"""Surface defects: detected, distinguished and estimated."""
