"""Cases: the input of one drop, and its keys by name."""
