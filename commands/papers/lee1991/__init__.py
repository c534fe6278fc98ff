"""Lee, Chong, Suh, Choi, Lyou 1991."""
