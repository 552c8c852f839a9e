"""The plant of a drive's loop, identified from one record by every method for closed loops."""
