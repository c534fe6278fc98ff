"""Baselines and evaluation in cells of several arms."""
