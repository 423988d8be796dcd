"""Force histories as files of other programs."""
