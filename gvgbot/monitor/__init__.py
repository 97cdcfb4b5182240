"""A live view of a robot in a terminal."""
