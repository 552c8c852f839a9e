"""Help for a user at the command line: what is installed here, what to cite, what to complete."""
