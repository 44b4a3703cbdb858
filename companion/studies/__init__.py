"""What the book asks: a module or folder a question."""
