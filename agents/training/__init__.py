"""Training by Stable-Baselines3: environments, models, checkpoints, sweeps."""
