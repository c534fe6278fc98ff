"""Each paper's quantities and figures beside ours."""
