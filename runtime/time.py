"""Logical time: integer nanoseconds on the wire, float seconds inside the maths."""

Time = int
"""Nanoseconds since the start of a simulation, or since the Unix epoch on a robot."""

MILLISECOND: Time = 1_000_000
SECOND: Time = 1_000_000_000


def seconds(time: Time) -> float:
    """Return a time or a duration in s."""
    return time / SECOND


def nanoseconds(duration: float) -> Time:
    """Return a duration in s as the nearest whole number of ns."""
    return round(duration * SECOND)
