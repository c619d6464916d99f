"""``python -m handcal_gui``."""

from handcal_gui.app import main

if __name__ == "__main__":
    main()
