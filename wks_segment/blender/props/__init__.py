"""Properties of the extension: settings of a scene, rows of its lists, preferences, presets.

The properties know nothing of the packages above: what follows from a change of theirs is announced in `changes`.
"""
