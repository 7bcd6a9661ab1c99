"""The command, as `obscurance.cli`, by a name that is this project's own: `python -m obscurance`.

Its file is `cli.py` beside this folder in the source tree, and in the folder `command` of a wheel, lest another
package's `cli.py` replace it.
"""

import os.path

_folder = os.path.dirname(__file__)
_in_wheel = os.path.join(_folder, "command")
__path__.append(_in_wheel if os.path.isdir(_in_wheel) else os.path.dirname(_folder))
