"""Experiments of the predictive method, past the paper's: its bar, goals all around, and one parameter at a time."""
