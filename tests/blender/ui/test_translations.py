"""The interface in German: nothing of it is left in English."""

import bpy
import pytest

from wks_segment.blender import registration
from wks_segment.blender.ui.german.interface_texts import GERMAN_INTERFACE, GERMAN_OPERATORS
from wks_segment.blender.ui.translations import MESSAGE, NAME, OPERATOR, TRANSLATIONS

pytestmark = pytest.mark.usefixtures("scene")
BLENDERS = {"", "Name", "Number", "Color", "Unique name used in the code and scripting", "File Path", "Path to file"}
"""What Blender translates itself, or gives to properties that it makes."""
MADE_BY_BLENDER = {
    "check_existing",
    "filepath",
    "filter_glob",
    "hide_props_region",
    "remove_name",
    "remove_active",
    "bl_idname",
}


def texts_of(properties):
    """Names and descriptions of properties that are seen, and of what can be chosen."""
    for found in properties:
        if found.is_hidden or found.identifier in MADE_BY_BLENDER or found.identifier == "rna_type":
            continue
        yield from (found.name, found.description)
        if found.type == "ENUM":
            for item in found.enum_items:
                yield from (item.name, item.description)


def shown(classes):
    """(context, text) of all that the classes show."""
    for cls in classes:
        if issubclass(cls, bpy.types.Operator):
            kind = getattr(bpy.ops.wks_segment, cls.bl_idname.partition(".")[2]).get_rna_type()
            yield OPERATOR, cls.bl_label
            yield "*", kind.description
            if cls.bl_idname != "wks_segment.add_preset":
                yield from (("*", text) for text in texts_of(kind.properties))
        elif issubclass(cls, bpy.types.PropertyGroup | bpy.types.AddonPreferences):
            yield from (("*", text) for text in texts_of(cls.bl_rna.properties))
        else:
            yield "*", getattr(cls, "bl_label", "")


def test_all_that_is_shown_has_a_german_text(extension):
    known = {(context, text) for context, text in TRANSLATIONS["de_DE"] if context not in (MESSAGE, NAME)}
    needed = {(context, text) for context, text in shown(registration.CLASSES) if text not in BLENDERS}
    assert needed - known == set()
    assert known - needed == set(), "these are no longer shown"


def test_texts_are_german_and_without_a_full_stop():
    for english, german in (GERMAN_INTERFACE | GERMAN_OPERATORS).items():
        assert german.strip() == german != ""
        assert not german.endswith("."), german
        # What is the same in both languages is a name.
        assert german != english or len(english) < 16, english


def test_blender_knows_them_as_long_as_the_extension_is_there(extension):
    view = bpy.context.preferences.view
    before = view.language
    try:
        view.language = "de_DE"
    except TypeError:
        pytest.skip("this Blender was built without languages")
    view.use_translate_interface = True
    try:
        assert bpy.app.translations.pgettext_iface("Learn and Segment", OPERATOR) == "Lernen und segmentieren"
        extension.unregister()
        try:
            assert bpy.app.translations.pgettext_iface("Learn and Segment", OPERATOR) == "Learn and Segment"
        finally:
            extension.register()
    finally:
        view.language = before
