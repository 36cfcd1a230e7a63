"""Drivers of a Festo Robotino: over its serial link and over REST, and a double of each link."""
