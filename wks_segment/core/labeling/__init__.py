"""From a fitted model to labels: smooth borders, named regions, left and right."""
