"""Finding and reading files; messages that name file, key, value and remedy."""
