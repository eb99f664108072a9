"""Described poses: a mesh with its signature, computed once and cached."""
