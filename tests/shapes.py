"""The checker of shapes and types at run time: an int is a float too, as in the type checker (PEP 484)."""

from beartype import BeartypeConf, beartype

checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
