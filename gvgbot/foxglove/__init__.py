"""The robot in Foxglove: a live view, and layouts for it and for recordings."""
