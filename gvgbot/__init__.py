"""gvgbot: a robot that maps a building by itself, along its generalized Voronoi graph."""

__version__ = "0.1.0"
