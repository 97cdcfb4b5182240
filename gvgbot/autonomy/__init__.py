"""From HAL messages to a twist: pure functions, and one task around them."""
