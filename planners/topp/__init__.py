"""Minimum time along one joint path: path dynamics, phase plane, trajectories (Lee1991 section 2.2)."""
