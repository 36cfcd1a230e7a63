"""Colours of the pictures, RGBA, chosen for a dark ground. One thing keeps one colour in the map and in every plot."""

from __future__ import annotations

Colour = tuple[int, int, int, int]

FREE: Colour = (38, 43, 54, 255)
UNKNOWN: Colour = (22, 24, 30, 255)
OCCUPIED: Colour = (196, 202, 214, 255)

CORRIDOR: Colour = (255, 205, 40, 255)  # E, W_p
CORRIDOR_FILL: Colour = (70, 64, 40, 255)
OBJECT_CORRIDOR: Colour = (70, 220, 110, 255)  # E_o, W_o
OBJECT_CORRIDOR_FILL: Colour = (46, 76, 54, 255)
PATH: Colour = (255, 96, 96, 255)  # Q
PUSH_LINE: Colour = (255, 255, 255, 255)  # o-t
TARGET: Colour = (255, 80, 200, 255)  # t
PUSH_POSITION: Colour = (120, 230, 255, 255)  # p
GOAL: Colour = (90, 255, 140, 255)
GONE: Colour = (140, 146, 158, 255)

ROBOT: Colour = (66, 133, 255, 255)
OBJECT: Colour = (255, 140, 40, 255)
PREDICTED: Colour = (214, 170, 110, 255)
TRUTH: Colour = (240, 240, 240, 255)
TRUTH_LINE: Colour = (150, 156, 168, 255)
SCAN: Colour = (255, 70, 70, 255)
FLOOR_MET: Colour = (255, 170, 40, 255)
RANGE: Colour = (255, 190, 90, 255)

ALPHA: Colour = (255, 90, 90, 255)
GAMMA: Colour = (86, 168, 255, 255)
MEAN_GAMMA: Colour = (130, 240, 255, 255)
MU: Colour = (195, 120, 255, 255)
ALPHA_P: Colour = (120, 230, 130, 255)
PSI: Colour = (195, 120, 255, 255)

LEARNED: Colour = (0, 226, 196, 255)
LEARNED_FAINT: Colour = (0, 122, 108, 255)
EASY_AXIS: Colour = (255, 240, 90, 255)
TURNS_NOT: Colour = (240, 240, 240, 255)
TURNS_LEFT: Colour = (255, 60, 60, 255)
TURNS_RIGHT: Colour = (60, 120, 255, 255)
OBJECT_EXPECTED: Colour = (255, 190, 130, 255)
ROBOT_EXPECTED: Colour = (150, 190, 255, 255)
TAKEN: Colour = (240, 240, 240, 255)

COMMAND: Colour = (255, 96, 160, 255)
BASE: Colour = (90, 220, 150, 255)
DISTANCE: Colour = (255, 205, 40, 255)
ZERO: Colour = (120, 126, 138, 255)

GOOD: Colour = (46, 140, 84, 255)
DELIVERED: Colour = (28, 176, 120, 255)
BUSY: Colour = (58, 102, 190, 255)
WARN: Colour = (196, 120, 30, 255)
BAD: Colour = (190, 50, 50, 255)
QUIET: Colour = (78, 84, 96, 255)
