"""``python -m handcal_gui``."""

from handcal_gui.app.start import main

if __name__ == "__main__":
    main()
