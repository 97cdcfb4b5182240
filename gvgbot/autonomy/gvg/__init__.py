"""Scans to the local generalized Voronoi graph."""
