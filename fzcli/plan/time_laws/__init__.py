"""Rest-to-rest time laws, one a file."""
