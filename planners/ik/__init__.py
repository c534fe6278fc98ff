"""Inverse kinematics: the feedback law (Chung) with error bounds, Newton, closed forms."""
