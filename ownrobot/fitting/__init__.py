"""A model of your own robot from its recorded drives: fit, evaluate, predict."""
