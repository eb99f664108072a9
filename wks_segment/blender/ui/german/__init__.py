"""The German texts: messages, names and descriptions of the interface, and names of parts of a body."""
