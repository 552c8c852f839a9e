"""Reading of users' files: columns of numbers with names and units."""
