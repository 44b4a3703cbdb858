"""Driving to goals with a learned model."""
