"""Feeds the parsers of a base's wire with what no base says: `python -m experiments.fuzz` or `make fuzz`."""
