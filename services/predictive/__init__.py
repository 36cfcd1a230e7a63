"""How an object answers pushes, and what to do about it: model, law, rollouts (docs/predictive.md)."""
