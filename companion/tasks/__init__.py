"""A benchmark that others enter: methods of every kind on the same tasks."""
