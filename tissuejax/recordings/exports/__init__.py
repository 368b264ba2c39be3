"""Raw exports of test machines, indenters, motion capture and image correlation: one file a format, found by walking.

`TableExport`s give named columns (`export.py`), which a side file then turns into recordings; `MarkerExport`s give
positions of points over time (`tracked.py`). `text.py` finds the tables in a text file of unknown layout,
`meanings.py` knows what columns are called.
"""
