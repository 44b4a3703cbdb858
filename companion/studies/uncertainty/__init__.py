"""Encoders, SIDM and decoders that estimate distributions."""
