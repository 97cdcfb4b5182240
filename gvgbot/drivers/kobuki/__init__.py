"""Kobuki base over its serial protocol."""
