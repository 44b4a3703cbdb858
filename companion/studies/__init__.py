"""The studies of the book: one module or folder for each question."""
