"""The REST interface of Robotino 3 and 4."""
