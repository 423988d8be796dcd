"""What fits are made of: targets, ranges, search, inference, result."""
