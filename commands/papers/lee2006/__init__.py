"""Lee, Ryu, Cheong 2006."""
