"""What the book and the README take from results."""
