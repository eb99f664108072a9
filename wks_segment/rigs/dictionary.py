"""Words in the names of bones, as common rigs have them, and the plain names that they stand for.

Rigs: Rigify, Mixamo, VRM, Unreal Engine 4 and 5, Auto-Rig Pro, MakeHuman, Daz, Character Creator, 3ds Max Biped, Unity
humanoids, and the free animals and people of Quaternius and KayKit.
"""

from __future__ import annotations

FILLERS = frozenset({
    "armature", "b", "base", "bind", "biped", "bip", "bone", "bones", "c", "cc", "cf", "ctrl", "def", "deform",
    "fk", "ik", "j", "jnt", "joint", "jt", "master", "mch", "metarig", "mixamorig", "nub", "org", "p", "rig", "sk",
    "skel", "skeleton", "skin", "stretch", "tweak", "valve", "x", "bend", "twist", "roll", "helper", "main",
})  # fmt: skip
"""Words that say nothing about the place of a bone: prefixes of rigs, kinds of bones, and twists of a limb."""

PLAIN_NAMES: dict[str, str] = {
    # head
    "head": "Head", "skull": "Head", "face": "Head", "headtop": "Head", "headend": "Head",
    "neck": "Neck", "necklower": "Neck", "neckupper": "Neck", "throat": "Neck",
    "jaw": "Jaw", "chin": "Jaw", "lowermouth": "Jaw", "lowerjaw": "Jaw", "jawroot": "Jaw", "upperjaw": "Muzzle",
    "mouth": "Mouth", "lip": "Mouth", "lips": "Mouth", "upperlip": "Mouth", "lowerlip": "Mouth", "oris": "Mouth",
    "risorius": "Mouth", "teeth": "Mouth", "tooth": "Mouth", "muzzle": "Muzzle", "snout": "Muzzle", "beak": "Muzzle",
    "nose": "Nose", "nostril": "Nose", "tongue": "Tongue",
    "eye": "Eye", "eyes": "Eye", "eyeball": "Eye", "eyelid": "Eye", "lid": "Eye", "eyebrow": "Brow", "brow": "Brow",
    "orbicularis": "Eye", "oculi": "Brow", "levator": "Cheek", "temporalis": "Head", "special": "Head",
    "cheek": "Cheek", "forehead": "Brow", "temple": "Head", "ear": "Ear", "ears": "Ear",
    "hair": "Hair", "bangs": "Hair", "ponytail": "Hair", "mane": "Mane", "beard": "Beard", "horn": "Horn",
    "antler": "Horn", "antlers": "Horn", "hat": "Hat", "helmet": "Hat", "crown": "Hat", "hood": "Hat", "cap": "Hat",
    "mandible": "Jaw", "maxilla": "Muzzle", "pupil": "Eye", "iris": "Eye", "eyelash": "Eye", "lash": "Eye",
    "glasses": "Eye", "ponytails": "Hair", "pigtail": "Hair", "braid": "Hair", "antenna": "Antenna",
    "antennae": "Antenna", "feeler": "Antenna",
    # torso
    "torso": "Torso", "body": "Torso", "trunk": "Torso", "spine": "Spine", "spines": "Spine", "back": "Back",
    "chest": "Chest", "upperchest": "Chest", "ribcage": "Chest", "ribs": "Chest", "rib": "Chest", "thorax": "Chest",
    "breast": "Breast", "bust": "Breast", "pectoral": "Breast", "boob": "Breast", "nipple": "Breast",
    "abdomen": "Abdomen", "abdomenlower": "Abdomen", "abdomenupper": "Abdomen", "belly": "Abdomen",
    "stomach": "Abdomen", "waist": "Abdomen", "hips": "Hips", "hip": "Hips", "pelvis": "Hips", "butt": "Hips",
    "buttock": "Hips", "glute": "Hips", "cog": "Hips", "root": "Torso", "all": "Torso", "bodylow": "Lower Torso",
    "lowerbody": "Lower Torso", "bodylower": "Lower Torso", "bodyup": "Upper Torso", "upperbody": "Upper Torso",
    "bodyupper": "Upper Torso", "shell": "Torso", "sternum": "Chest", "withers": "Back", "loin": "Back",
    "rump": "Hips", "croup": "Hips", "lumbar": "Spine", "vertebra": "Spine", "thoracic": "Spine", "torsolower": "Torso",
    "torsoupper": "Torso", "backpack": "Held Item",
    # arms
    "shoulder": "Shoulder", "shoulders": "Shoulder", "clavicle": "Shoulder", "collar": "Shoulder",
    "collarbone": "Shoulder", "scapula": "Shoulder", "frontshoulder": "Shoulder", "foreshoulder": "Shoulder",
    "arm": "Arm", "upperarm": "Upper Arm", "uparm": "Upper Arm", "armupper": "Upper Arm", "bicep": "Upper Arm",
    "biceps": "Upper Arm", "humerus": "Upper Arm", "shldr": "Upper Arm", "upperarmtwist": "Upper Arm",
    "forearm": "Forearm", "lowerarm": "Forearm", "lowarm": "Forearm", "loarm": "Forearm", "armlower": "Forearm",
    "elbow": "Forearm", "ulna": "Forearm", "radius": "Forearm", "wrist": "Hand", "hand": "Hand", "palm": "Hand",
    "metacarpal": "Hand", "carpal": "Hand", "finger": "Finger", "fingers": "Finger", "thumb": "Thumb",
    "index": "Finger", "middle": "Finger", "ring": "Finger", "pinky": "Finger", "pinkie": "Finger",
    "little": "Finger", "mid": "Finger", "handslot": "Held Item", "handsocket": "Held Item",
    "sockethand": "Held Item", "weapon": "Held Item", "sword": "Held Item", "shield": "Held Item", "prop": "Held Item",
    # legs
    "leg": "Leg", "thigh": "Thigh", "upperleg": "Thigh", "upleg": "Thigh", "legupper": "Thigh", "femur": "Thigh",
    "shin": "Shin", "calf": "Shin", "lowerleg": "Shin", "lowleg": "Shin", "loleg": "Shin", "leglower": "Shin",
    "knee": "Shin", "tibia": "Shin", "crus": "Shin", "midleg": "Knee",
    "hock": "Foot", "hamstring": "Thigh", "quad": "Thigh", "kneecap": "Shin", "boot": "Foot", "shoe": "Foot",
    "ankle": "Foot", "foot": "Foot", "feet": "Foot", "footback": "Foot", "heel": "Foot", "metatarsal": "Foot",
    "metatarsals": "Foot", "tarsal": "Foot", "paw": "Foot", "hoof": "Foot",
    "toe": "Toes", "toes": "Toes", "toebase": "Toes", "ball": "Toes", "bigtoe": "Toes", "toeend": "Toes",
    # four and more legs
    "frontleg": "Foreleg", "foreleg": "Foreleg", "frontarm": "Foreleg", "legfront": "Foreleg",
    "frontupperleg": "Upper Foreleg", "frontupleg": "Upper Foreleg", "upperfrontleg": "Upper Foreleg",
    "upperforeleg": "Upper Foreleg", "frontthigh": "Upper Foreleg", "frontlowerleg": "Lower Foreleg",
    "frontlowleg": "Lower Foreleg", "lowerfrontleg": "Lower Foreleg", "lowerforeleg": "Lower Foreleg",
    "frontshin": "Lower Foreleg", "frontfoot": "Forepaw", "frontpaw": "Forepaw", "forepaw": "Forepaw",
    "forefoot": "Forepaw", "frontpalm": "Forepaw", "ff": "Forepaw", "fronttoe": "Forepaw", "fronthoof": "Forepaw",
    "backleg": "Hind Leg", "hindleg": "Hind Leg", "rearleg": "Hind Leg", "legback": "Hind Leg",
    "backshoulder": "Back", "hindshoulder": "Back", "backupperleg": "Upper Hind Leg", "backupleg": "Upper Hind Leg",
    "hindupperleg": "Upper Hind Leg", "rearupperleg": "Upper Hind Leg", "upperbackleg": "Upper Hind Leg",
    "upperhindleg": "Upper Hind Leg", "backthigh": "Upper Hind Leg", "hindthigh": "Upper Hind Leg",
    "backlowerleg": "Lower Hind Leg", "backlowleg": "Lower Hind Leg", "hindlowerleg": "Lower Hind Leg",
    "rearlowerleg": "Lower Hind Leg", "lowerbackleg": "Lower Hind Leg", "lowerhindleg": "Lower Hind Leg",
    "backshin": "Lower Hind Leg", "hindshin": "Lower Hind Leg", "backfoot": "Hind Paw", "hindfoot": "Hind Paw",
    "rearfoot": "Hind Paw", "backpaw": "Hind Paw", "hindpaw": "Hind Paw", "rearpaw": "Hind Paw", "ffb": "Hind Paw",
    "backtoe": "Hind Paw", "hindtoe": "Hind Paw", "backhoof": "Hind Paw", "hindhoof": "Hind Paw",
    "stifle": "Upper Hind Leg", "gaskin": "Lower Hind Leg", "backknee": "Lower Hind Leg", "hindknee": "Lower Hind Leg",
    "frontknee": "Lower Foreleg", "frontelbow": "Lower Foreleg", "frontankle": "Forepaw", "backankle": "Hind Paw",
    "fetlock": "Foot", "pastern": "Foot", "claw": "Claw", "pincer": "Claw", "talon": "Foot", "tentacle": "Tentacle",
    "midfrontleg": "Front Middle Leg", "midbackleg": "Back Middle Leg", "midfrontfoot": "Front Middle Foot",
    "midbackfoot": "Back Middle Foot", "middleleg": "Middle Leg",
    # tails, wings, clothes
    "tail": "Tail", "tailbase": "Tail", "tailtip": "Tail", "wing": "Wing", "fin": "Fin", "flipper": "Fin",
    "feather": "Wing", "skirt": "Skirt", "cape": "Cape", "cloak": "Cape", "robe": "Skirt", "cloth": "Clothes",
    "belt": "Clothes", "sleeve": "Clothes", "scarf": "Clothes", "coat": "Clothes", "dress": "Skirt", "tie": "Clothes",
    "pouch": "Held Item", "bag": "Held Item", "gun": "Held Item", "staff": "Held Item", "bow": "Held Item",
}  # fmt: skip
"""Plain name by the words of a bone without side, numbers and fillers, in lower case and without spaces."""

BROADER: dict[str, str] = {
    **dict.fromkeys(("Finger", "Thumb"), "Hand"),
    "Toes": "Foot",
    **dict.fromkeys(
        ("Jaw", "Mouth", "Muzzle", "Nose", "Tongue", "Eye", "Brow", "Cheek", "Ear", "Hair", "Mane", "Beard", "Horn",
         "Hat", "Antenna"), "Head",
    ),
    **dict.fromkeys(
        ("Spine", "Back", "Chest", "Breast", "Abdomen", "Hips", "Lower Torso", "Upper Torso", "Shoulder"), "Torso"
    ),
    **dict.fromkeys(("Upper Arm", "Forearm", "Hand"), "Arm"),
    "Knee": "Shin",
    **dict.fromkeys(("Thigh", "Shin", "Foot"), "Leg"),
    **dict.fromkeys(("Upper Foreleg", "Lower Foreleg", "Forepaw"), "Foreleg"),
    **dict.fromkeys(("Upper Hind Leg", "Lower Hind Leg", "Hind Paw"), "Hind Leg"),
    **dict.fromkeys(("Skirt", "Cape"), "Clothes"),
}  # fmt: skip
"""The name of the larger part of the body that a named part belongs to."""

DETAILS = frozenset(name for name, broader in BROADER.items() if broader in ("Hand", "Foot", "Head"))
"""Names of small parts that belong to a larger one before any other parts are joined."""

MIDLINE = frozenset({
    "Head", "Neck", "Jaw", "Mouth", "Muzzle", "Nose", "Tongue", "Mane", "Beard", "Hat", "Torso", "Spine", "Back",
    "Chest", "Abdomen", "Hips", "Tail", "Skirt", "Cape", "Clothes", "Lower Torso", "Upper Torso",
})  # fmt: skip
"""Names of parts that are one part of the body, although some rigs have bones for both halves."""

STANDARD = (
    "Head", "Ear", "Neck", "Torso", "Hips", "Upper Arm", "Forearm", "Hand", "Thigh", "Shin", "Foot", "Upper Foreleg",
    "Lower Foreleg", "Forepaw", "Upper Hind Leg", "Lower Hind Leg", "Hind Paw", "Tail", "Wing", "Fin", "Arm", "Leg",
    "Foreleg", "Hind Leg", "Middle Leg", "Front Middle Leg", "Back Middle Leg", "Held Item", "Clothes",
)  # fmt: skip
"""Names of the parts that people and animals are divided into if nobody asks for a number: those that an artist masks,
textures or rigs on its own."""

UPPER_OF = {"Arm": "Upper Arm", "Leg": "Thigh", "Foreleg": "Upper Foreleg", "Hind Leg": "Upper Hind Leg"}
"""What a bone named as a whole limb is, if the limb goes on below it."""
NAMED_BY_JOINT = {"Shoulder": ("Forearm", "Upper Arm"), "Hips": ("Shin", "Thigh")}
"""What a bone on one side that is named as the joint at its beginning is, if the next part hangs on it."""
LOWER_OF = {"Arm": "Forearm", "Leg": "Shin", "Foreleg": "Lower Foreleg", "Hind Leg": "Lower Hind Leg"}
"""What a bone named as a whole limb is, if the limb begins above it."""
ABOVE = {
    "Hand": "Forearm", "Forearm": "Upper Arm", "Foot": "Shin", "Shin": "Thigh", "Toes": "Foot",
    "Forepaw": "Lower Foreleg", "Lower Foreleg": "Upper Foreleg", "Hind Paw": "Lower Hind Leg",
    "Lower Hind Leg": "Upper Hind Leg",
}  # fmt: skip
"""The part of a limb above another one."""


def broader_names(name: str) -> list[str]:
    """A plain name, and the names of the larger parts that it belongs to, the smallest first."""
    names = [name]
    while names[-1] in BROADER:
        names.append(BROADER[names[-1]])
    return names
