"""One arm follows a pose; the agent sets joint speeds, or the gains of the feedback law."""
