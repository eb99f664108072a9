"""Shape of a surface in space: heat flow, creases and thickness, and cuts along them."""
