"""One module for each command, which adds its parser and runs it."""
