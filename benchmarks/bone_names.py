"""Names from bones: `python -m benchmarks.bone_names FILE… [--parts N]`.

For each rigged file the share of the area whose bones the dictionary names, the number of bones that move the surface
(both of a pair as one), and the parts: the usual ones, or N. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import bpy

from benchmarks.speed import table_row
from wks_segment.blender.errors import UserError
from wks_segment.blender.scene.bone_weights import bone_tree_of
from wks_segment.blender.scene.characters import group, mesh_objects
from wks_segment.blender.scene.file_formats import open_files
from wks_segment.rigs import BoneTree, parts_of_faces, rows_by_number, usual_rows


def tree_of(path: Path) -> BoneTree:
    """The bones of all meshes in a file; UserError if there are none."""
    meshes = [obj for obj in mesh_objects(open_files([path])[0]) if obj.name in bpy.context.view_layer.objects]
    return bone_tree_of(group(meshes, together=True)[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    parser.add_argument("--parts", type=int, help="number of parts, both sides of a pair as one")
    options = parser.parse_args()
    rows, shares = [], []
    for path in options.files:
        try:
            tree = tree_of(path)
        except UserError as error:
            rows.append(table_row([path.stem, "", "", str(error)]))
            continue
        own, names = usual_rows(tree.rows) if options.parts is None else (rows_by_number(tree.rows, options.parts), ())
        parts = parts_of_faces([tree], [own], names=[names]).parts
        shares.append(tree.named_area())
        cells = [path.stem, f"{shares[-1]:.3f}", str(len(tree.rows)), ", ".join(part.full_name for part in parts)]
        rows.append(table_row(cells))
    print(f"| rig | area named | bones | parts |\n|{'---|' * 4}", *rows, sep="\n")
    if shares:
        print(table_row([f"**mean of {len(shares)}**", f"**{sum(shares) / len(shares):.3f}**", "", ""]))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # some versions of bpy crash at a normal exit
