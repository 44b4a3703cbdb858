"""The commands of `sidm`: their options, and what they print."""
