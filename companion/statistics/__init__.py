"""Intervals over seeds, how much data a method saves, and what that says of a claim."""
