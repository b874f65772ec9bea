"""Floor 5: what physics leaves, learned by a small network through the rollout; what was learned, in physical words."""
