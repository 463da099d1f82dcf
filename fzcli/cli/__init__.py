"""The command line: one small module a command; the rooms below are imported inside the functions."""
