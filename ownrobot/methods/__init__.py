"""Methods beside the paper's: those that it only names, and common alternatives."""
