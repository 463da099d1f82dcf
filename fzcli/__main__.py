"""``python -m fzcli`` is the same as ``fzcli``."""

from fzcli.cli.main import main

if __name__ == "__main__":
    main()
