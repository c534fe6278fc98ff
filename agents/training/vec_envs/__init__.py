"""Our environments as vectors of Stable-Baselines3."""
