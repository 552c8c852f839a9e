"""Random members of an uncertain system, beside what is proven of all of them."""
