"""Labels of a pose by a fitted model: smooth borders, named regions, left and right."""
