"""The graph to the next destination."""
