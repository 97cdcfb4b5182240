"""From HAL messages to a twist: no I/O, clock or chance, and one task around that."""
