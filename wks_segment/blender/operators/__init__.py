"""The operators, one file each. `_base` is what they share, `_report` what they tell the user."""
