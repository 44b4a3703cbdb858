"""Which method suits a robot: all of them on the same drives, by cross-validation."""
