"""Named parts from the bones of a rig: plain names, the tree of bones, and which bones together are a part.

Needs no Blender: bones come as names and parents, and the skin as arrays.
"""

from .bone_names import BoneName, plain_names, read_name, split_side
from .bone_parts import BonePart, PartsOfFaces, parts_of_faces, rows_by_names, rows_by_number, usual_rows
from .bone_tree import BoneRow, BoneTree
from .dictionary import STANDARD
from .skeleton import Skeleton
from .skin import Skin

__all__ = [
    "STANDARD",
    "BoneName",
    "BonePart",
    "BoneRow",
    "BoneTree",
    "PartsOfFaces",
    "Skeleton",
    "Skin",
    "parts_of_faces",
    "plain_names",
    "read_name",
    "rows_by_names",
    "rows_by_number",
    "split_side",
    "usual_rows",
]
