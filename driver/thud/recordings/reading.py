"""Files of recorded channels as signals in newtons."""
