"""``python -m sixd`` is ``sixd``."""

from sixd.cli.main import run

run()
