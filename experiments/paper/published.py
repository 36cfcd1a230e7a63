"""What the paper prints, to stand beside our numbers. Tables 2, 3 and 4, and the counts in the text of Sec. 6.3.1."""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """Means over successful deliveries: L_Qr and L_Qo, m, and time, s; and successes of trials."""

    robot_length: float
    object_length: float
    time: float
    successes: int
    trials: int


SUCCESS_1 = {"strict": (19, 20), "relaxed": (17, 20)}
"""Sec. 6.3.1: successes of trials over all four scenes. Fig. 7c has no numbers."""

TABLE_2 = {
    ("corridor-1", "fixed-lookahead"): Row(9.5867, 8.7938, 120.9857, 18, 21),
    ("corridor-1", "strict"): Row(4.7355, 4.6426, 59.0214, 20, 21),
    ("corridor-1", "relaxed"): Row(6.1826, 6.1801, 69.2667, 19, 21),
    ("corridor-2", "fixed-lookahead"): Row(8.0976, 7.5975, 101.2600, 18, 21),
    ("corridor-2", "strict"): Row(7.2940, 6.2419, 88.3857, 18, 21),
    ("corridor-2", "relaxed"): Row(6.1147, 5.8851, 46.0042, 17, 21),
}

TABLE_3 = {
    "adaptive": Row(4.3529, 4.4050, 53.6308, 19, 21),
    "non-adaptive": Row(3.7564, 3.8940, 37.2708, 12, 21),
    "dipole": Row(4.5969, 4.7584, 47.5775, 10, 21),
    "centroid": Row(4.1633, 4.548, 110.0542, 8, 21),
}

TABLE_4 = {
    "dino": ((5, 6), (8, 9), (1, 3), (1, 3), (1, 3)),
    "plane": ((5, 6), (8, 9), (1, 3), (1, 3), (1, 3)),
    "can": ((6, 6), (9, 9), (3, 3), (3, 3), (3, 3)),
    "cart": ((5, 6), (6, 9), (0, 3), (0, 3), (2, 3)),
    "cloud": ((6, 6), (8, 9), (1, 3), (1, 3), (1, 3)),
    "cheezit": ((5, 6), (8, 9), (2, 3), (0, 3), (1, 3)),
    "box": ((6, 6), (9, 9), (3, 3), (2, 3), (1, 3)),
}
"""Object -> counts in the order of TABLE_4_COLUMNS. The column of sixes is headed "Relaxed" in print; its sum, 38 of
42, is that of the strict strategy in Table 2, and nines fit relaxed in Corridors 1, 2 and 3."""

TABLE_4_COLUMNS = ("strict", "relaxed", "non-adaptive", "centroid", "dipole")
