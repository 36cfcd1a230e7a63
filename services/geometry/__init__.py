"""Plane geometry that several services share: angles, polylines, the corridor's depth."""
