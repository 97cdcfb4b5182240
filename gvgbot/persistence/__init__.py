"""What outlives the process: the mission as a journal and a snapshot, in a form of its own."""
