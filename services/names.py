"""The strategies and controllers that a goal can ask for, by the names users type."""

STRATEGIES: tuple[str, ...] = ("strict", "relaxed", "fixed-lookahead", "switching", "predictive")
CONTROLLERS: tuple[str, ...] = ("adaptive", "non-adaptive", "centroid", "dipole", "predictive")
