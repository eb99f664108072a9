"""The operators: one file for each button or menu entry, or for a few that belong together."""
