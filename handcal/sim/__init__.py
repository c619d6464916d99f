"""An honest simulator: hand, room, depth camera, wearer and virtual headset."""
