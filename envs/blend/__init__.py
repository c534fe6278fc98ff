"""One arm on a blended path; the agent overrides the feed rate."""
