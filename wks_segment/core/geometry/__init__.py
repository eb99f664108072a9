"""Shape of a surface beyond its spectrum: heat flow, creases and thickness, and cuts along them."""
