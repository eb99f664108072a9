"""The German texts: `messages`, the `interface` (names and descriptions of settings and buttons), and `names` of parts."""
