"""The commands of `ownrobot`: their options, and what they print."""
