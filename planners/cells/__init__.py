"""Cells of every kind, built from their files and certified."""
