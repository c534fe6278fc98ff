"""When arms move: bounds, delays, intervals, velocity control, precedence, on charts and planes alone."""
