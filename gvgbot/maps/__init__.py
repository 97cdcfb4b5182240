"""What a run leaves behind: the route graph, the occupancy grid, trajectories and a picture."""
