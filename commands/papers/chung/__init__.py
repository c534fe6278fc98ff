"""Chung, Ryu, Park."""
