"""Experiments and benchmarks: every figure the project states is printed by a command here."""
