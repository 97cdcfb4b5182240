"""Devices: byte streams, protocols, drivers, and the twins that answer like the hardware."""
