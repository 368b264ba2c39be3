"""tissuejax: find what your tissue model left out."""
