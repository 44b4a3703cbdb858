"""Figures of the book, all in one style."""
