"""What evaluations of every kind share."""
