"""What a record must be before anything is estimated from it, and whether it is."""
