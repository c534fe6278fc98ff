"""What environments of every kind share: entries, actions, rewards, random numbers, life cycle."""
