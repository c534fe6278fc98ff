"""Baselines and evaluation in IK cells."""
