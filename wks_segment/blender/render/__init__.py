"""Rendered pictures: contact sheets of poses and confusion matrices."""
