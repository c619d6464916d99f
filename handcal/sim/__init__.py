"""The simulator: hand, room, depth camera, wearer and virtual headset."""
