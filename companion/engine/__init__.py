"""Run trials, keep what comes out, and say where it comes from."""
