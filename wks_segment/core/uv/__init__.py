"""UV maps: where a surface is cut open so that it can be laid flat, and how good a map is."""
