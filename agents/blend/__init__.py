"""Baselines and evaluation in blend cells."""
