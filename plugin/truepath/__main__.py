"""``python -m truepath`` is the command ``truepath``."""

from truepath.cli import main

main()
