"""Drivers: the simulated base in SAPIEN; later the Robotino and cameras."""
