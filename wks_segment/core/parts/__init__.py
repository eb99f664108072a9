"""The parts of a shape as a person would draw them, from everything that is known of its poses."""
