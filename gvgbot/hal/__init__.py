"""The hardware abstraction: frozen, stamped messages in SI units, and the device protocols."""
