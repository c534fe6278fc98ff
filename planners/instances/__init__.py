"""Random cells, the benchmark set, instance files and the bench over them."""
