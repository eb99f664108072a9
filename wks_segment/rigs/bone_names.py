"""Plain names of bones: "mixamorig:LeftForeArm" is the Forearm on the left."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from .dictionary import ABOVE, FILLERS, LOWER_OF, NAMED_BY_JOINT, PLAIN_NAMES, UPPER_OF

NO_SIDE, LEFT_SIDE, RIGHT_SIDE = 0, 1, 2
"""Sides, numbered as the parts of a mesh number them."""
WORD_IN_NAME = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
"""A word or a number in a name: capital letters begin words, other signs separate them."""
SIDE_WORDS = {"l": LEFT_SIDE, "left": LEFT_SIDE, "r": RIGHT_SIDE, "right": RIGHT_SIDE}
LONGEST_CLEANED = 40
"""Maximum letters of a cleaned name: names of parts have at most 50, and get a number and a side."""


@dataclass(frozen=True)
class BoneName:
    """What the name of a bone says.

    Attributes
    ----------
    name : str
        Plain name without side, such as "Upper Arm"; the cleaned words of the bone if they are not known.
    side : int
        0 for the middle or unknown, 1 for left, 2 for right.
    known : bool
        Whether the dictionary has the name.
    words : tuple of str
        The bone's own words and numbers without its side, in lower case: the same for both bones of a pair.
    """

    name: str
    side: int
    known: bool
    words: tuple[str, ...]


def read_name(bone: str) -> BoneName:
    """Side and plain name of a bone by its name alone."""
    tokens = WORD_IN_NAME.findall(bone)
    lowered = [token.lower() for token in tokens]
    side, lowered = _side_of(lowered)
    words = [word for word in lowered if not word.isdecimal()]
    telling = [word for word in words if word not in FILLERS] or words
    known = _known(telling)
    if known is None:
        return BoneName(_cleaned(lowered) or bone.strip()[:LONGEST_CLEANED] or "Bone", side, False, tuple(lowered))
    return BoneName(known, side, True, tuple(lowered))


def split_side(name: str) -> tuple[str, int]:
    """A name as it is written, without its side, and the side; "arm.L" and "Left arm" are the arm on the left."""
    words = list(WORD_IN_NAME.finditer(name))
    found = [word for word in words if word[0].lower() in SIDE_WORDS]
    if not found or not any(word not in found and not word[0].isdecimal() for word in words):
        return name, NO_SIDE
    at = next((word for word in found if len(word[0]) > 1), found[-1])
    before, after = name[: at.start()], name[at.end() :]
    text = before.rstrip(" ._-") + after if not after or not after[0].isalpha() else before + after.lstrip(" ._-")
    return text.strip(" ._-"), SIDE_WORDS[at[0].lower()]


def plain_names(bones: Sequence[str], parents: Sequence[int]) -> list[BoneName]:
    """Names of the bones of a rig; a bone named as a whole limb is its upper or lower part if the limb has several.

    Parameters
    ----------
    bones
        Names, parents before their children.
    parents
        Index of each bone's parent, −1 for none.
    """
    names = [read_name(bone) for bone in bones]
    children: list[list[int]] = [[] for _ in bones]
    for bone, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(bone)
    for i, named in enumerate(names):
        below = {names[child].name for child in children[i]}
        joint = NAMED_BY_JOINT.get(named.name)
        if joint is not None and named.side and joint[0] in below:
            names[i] = named = BoneName(joint[1], named.side, True, named.words)
        if named.name not in UPPER_OF:
            continue
        above = names[parents[i]].name if parents[i] >= 0 else ""
        upper, lower = UPPER_OF[named.name], LOWER_OF[named.name]
        if above in (upper, named.name):
            names[i] = BoneName(lower if above == upper else named.name, named.side, True, named.words)
        elif below & {upper, lower} or any(ABOVE.get(name) == lower and above == upper for name in below):
            names[i] = BoneName(upper, named.side, True, named.words)
    return names


def _side_of(words: list[str]) -> tuple[int, list[str]]:
    """The side that some words name, and the others; a word that is left alone is no side."""
    found = [i for i, word in enumerate(words) if word in SIDE_WORDS]
    if found and any(not word.isdecimal() for i, word in enumerate(words) if i != found[-1]):
        at = next((i for i in found if len(words[i]) > 1), found[-1])
        return SIDE_WORDS[words[at]], words[:at] + words[at + 1 :]
    for i, word in enumerate(words):
        if word in PLAIN_NAMES or word in FILLERS:
            continue
        for text, side in sorted(SIDE_WORDS.items(), key=lambda item: -len(item[0])):
            for rest in (word.removeprefix(text), word.removesuffix(text)):
                if rest != word and rest in PLAIN_NAMES:
                    return side, [*words[:i], rest, *words[i + 1 :]]
    return NO_SIDE, words


def _known(words: Sequence[str]) -> str | None:
    """Plain name of the longest run of words that the dictionary has, the last of several; None if it has none."""
    for length in range(len(words), 0, -1):
        for start in range(len(words) - length, -1, -1):
            run = "".join(words[start : start + length])
            for known in (run, run.removesuffix("s")):
                if known in PLAIN_NAMES:
                    return PLAIN_NAMES[known]
    return None


def _cleaned(words: Sequence[str]) -> str:
    """Words of an unknown name with capitals; numbers stay, since they tell bones apart."""
    kept = [word.lstrip("0") or "0" if word.isdecimal() else word.capitalize() for word in words]
    return " ".join(kept)[:LONGEST_CLEANED].strip()
