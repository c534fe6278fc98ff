"""Several arms on given paths: the multi-agent, the yielding and the vector environments."""
