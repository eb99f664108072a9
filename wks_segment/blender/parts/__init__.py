"""Numbers, names and colors of parts, as they are shown and written; needs no Blender."""
