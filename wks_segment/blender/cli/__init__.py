"""The command line: `main` runs one of `commands`; options, reading of files and results are shared by the commands."""
