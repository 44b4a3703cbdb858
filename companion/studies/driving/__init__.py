"""Driving to goals with a learnt model."""
