"""Re-execution of recorded sessions, their comparison, and their pictures in Rerun."""
