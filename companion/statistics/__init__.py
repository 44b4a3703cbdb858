"""Intervals over seeds, how much data a method saves, and verdicts on claims."""
