"""The sidebar: panels, menus, preview, messages and their translations."""
