"""`pushlane robotino`: a health check of a real base, and one that is simulated for who has none."""
