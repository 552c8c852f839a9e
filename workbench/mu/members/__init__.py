"""Random members of an uncertain system, shown with what is proven for all members."""
