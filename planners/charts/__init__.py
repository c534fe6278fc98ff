"""Where two arms collide: coordination charts certified between samples, clearance tables."""
