"""Points, poses and paths in space: lines, arcs, targets over time, waypoint files."""
