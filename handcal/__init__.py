"""handcal: calibrate an optical see-through headset with the wearer's bare hand."""
