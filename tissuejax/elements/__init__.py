"""Finite elements, one a file, found by walking this folder."""
