"""Learns how this object answers to pushes (Sec. 5.3)."""
