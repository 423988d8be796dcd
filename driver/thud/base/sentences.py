"""The words of all notes: one sentence for each code, with the values of `thud.base.note.Note`."""

# What was done with a signal.
PROCESSING = {
    "offset_removed": "an offset of {value:.3g} {unit} was removed",
}

# What may be wrong.
WARNINGS: dict[str, str] = {}
