"""Local GVG to a twist."""
