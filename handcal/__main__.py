"""``python -m handcal`` is the command ``handcal``."""

from handcal.cli.main import main

if __name__ == "__main__":
    main()
