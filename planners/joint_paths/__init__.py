"""Joint paths ``q = f(lambda)`` (Lee1991 eq. 2): through waypoints, and along Cartesian paths."""
