"""What all rooms use: the bridge to the library, its schema, checks, errors, files and units."""
