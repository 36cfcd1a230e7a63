"""Writing sessions to MCAP so that a crash costs little and any reader understands them."""
