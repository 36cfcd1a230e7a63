"""`pushlane camera` and `pushlane calibrate`: real cameras on the command line."""
