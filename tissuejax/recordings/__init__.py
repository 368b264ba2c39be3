"""Recordings: what was done to a sample and what was measured, whatever file it came in.

`recording.py` holds the types, `files.py` is the door (read, write, convert), one file a format beside it (`hdf5.py`,
`table.py`), the layouts of the experiment kinds are data in `layouts.py`; `rig.py` and `images.py` turn a test rig's
raw signals and pictures into stretch and nominal stress.
"""
