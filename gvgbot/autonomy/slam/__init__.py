"""Belief, vertex recognition and the GVG graph."""
