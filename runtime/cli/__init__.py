"""The `pushlane` command line."""
