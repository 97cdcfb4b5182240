"""What a robot shows while it drives: to whoever watches, to ROS 2, and to the other robots."""
