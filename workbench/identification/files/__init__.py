"""From a file, as people have it, to columns of numbers with names and units."""
