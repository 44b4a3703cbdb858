"""A reproducible companion to Wang and Johnson, 'Domain Adaptation Using System Invariant Dynamics Models' (L4DC 2021).

The rooms and what each is for stand on the book's page on the design. Importing `sidm` itself imports none of them.
"""

__version__ = "0.2.0"
