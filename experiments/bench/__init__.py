"""Benchmarks. `python -m experiments.bench` prints every figure the documentation states about speed."""
