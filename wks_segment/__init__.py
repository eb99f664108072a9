"""WKS Segment: the same parts, labels and colors in every pose of a character.

`wks_segment.core` is the method (with NumPy, SciPy and scikit-learn), `wks_segment.blender` the Blender extension, and
`wks_segment.batch` runs the command line for many files. Importing this package imports none of them.
"""

__version__ = "0.2.0"
