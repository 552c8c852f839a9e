"""What a record must be before anything is estimated of it, and whether it is: tests, findings."""
