"""The values of a property group as they were, to set them again."""

from __future__ import annotations

from typing import Any

from ..props.changes import unheard


class PropertyState:
    """All values of a property group, with those of the groups in its collections."""

    def __init__(self, group: Any) -> None:
        self._values: dict[str, Any] = {}
        self._rows: dict[str, list[PropertyState]] = {}
        for prop in group.bl_rna.properties:
            name = prop.identifier
            if prop.type == "COLLECTION":
                self._rows[name] = [PropertyState(row) for row in getattr(group, name)]
            elif not prop.is_readonly and group.is_property_set(name):
                value = getattr(group, name)
                self._values[name] = tuple(value) if getattr(prop, "is_array", False) else value

    def restore(self, group: Any) -> None:
        """Set all values again, without telling anybody that they change."""
        with unheard():
            self._restore(group)

    def _restore(self, group: Any) -> None:
        for name, rows in self._rows.items():
            now = getattr(group, name)
            if [PropertyState(row) for row in now] != rows:
                now.clear()
                for row in rows:
                    row._restore(now.add())
        for prop in group.bl_rna.properties:
            name = prop.identifier
            if name in self._values:
                if group.is_property_set(name) and _same(getattr(group, name), self._values[name]):
                    continue
                setattr(group, name, self._values[name])
            elif prop.type != "COLLECTION" and not prop.is_readonly and group.is_property_set(name):
                group.property_unset(name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PropertyState) and (self._values, self._rows) == (other._values, other._rows)

    __hash__ = None  # type: ignore[assignment]  # values can be sets


def _same(now: Any, before: Any) -> bool:
    return bool((tuple(now) if isinstance(before, tuple) else now) == before)
