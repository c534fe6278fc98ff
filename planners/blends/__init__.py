"""Rounded corners of lines and arcs (Lee2006), their arc length and its inverse."""
