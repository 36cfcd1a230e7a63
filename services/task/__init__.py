"""Watches a push and scores it (Sec. 6.2)."""
