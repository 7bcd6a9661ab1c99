"""Names of files, as functions take them."""

import os

PathName = str | os.PathLike[str]
