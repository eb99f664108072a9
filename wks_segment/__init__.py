"""WKS Segment: the same parts, labels and colors in every pose of a character.

`wks_segment.core` is the method (NumPy, SciPy, scikit-learn), `wks_segment.blender` the Blender extension.
Importing this package imports neither.
"""

__version__ = "0.1.0"
