"""Contents of the book's pages and the README, and runs of the notebooks."""
