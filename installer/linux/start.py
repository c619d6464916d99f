"""Start of the packaged program."""

from handcal_gui.bundle import main

main()
