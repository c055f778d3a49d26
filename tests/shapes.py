"""The type checker behind ``--jaxtyping-packages=most,shapes.checked``: beartype, where an int will do for a float."""

from beartype import BeartypeConf, beartype

checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
