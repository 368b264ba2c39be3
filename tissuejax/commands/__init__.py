"""Sub-commands of `tissuejax`, one a file, found by walking this folder."""
