"""Help at the command line: the installation, citations, and completion of names."""
