"""Zenoh: sessions, keys and the envelope. The only place that imports zenoh."""
