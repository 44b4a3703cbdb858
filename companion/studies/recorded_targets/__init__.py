"""Recorded motion is the novice, the simulator the cheap expert."""
