"""ROS 2 as a neighbour, without ROS: its messages, and how rmw_zenoh lets them travel."""
