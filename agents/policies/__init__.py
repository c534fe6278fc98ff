"""The policy protocol, agent files and learned policies."""
