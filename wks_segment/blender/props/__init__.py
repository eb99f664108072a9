"""Properties of the extension: settings of a scene, rows of its lists, preferences, presets."""
