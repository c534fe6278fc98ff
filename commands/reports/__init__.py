"""Tables and pictures of an evaluation, by kind of cell."""
