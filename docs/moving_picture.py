"""Makes the README's moving picture of the pictures of the guide's steps, in their order.

python docs/moving_picture.py FOLDER    # of handcal-gui --screenshots FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

_WIDTH_PX, _COLOURS, _STEP_MS, _LAST_MS = 860, 96, 1600, 4000
_MOST_BYTES = 2_000_000


def main() -> None:
    """Write docs/pictures/calibration.gif."""
    frames = []
    for path in sorted(Path(sys.argv[1]).glob("step-*.png"), key=lambda path: path.stat().st_mtime):
        with Image.open(path) as image:
            height = round(image.height * _WIDTH_PX / image.width)
            small = image.convert("RGB").resize((_WIDTH_PX, height), Image.Resampling.LANCZOS)
            frames.append(small.quantize(_COLOURS, dither=Image.Dither.NONE))
    output = Path(__file__).parent / "pictures" / "calibration.gif"
    times = [_STEP_MS] * (len(frames) - 1) + [_LAST_MS]
    frames[0].save(
        output, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True
    )
    if (size := output.stat().st_size) > _MOST_BYTES:
        sys.exit(f"{output} has {size} bytes, more than {_MOST_BYTES}: use fewer colours")


if __name__ == "__main__":
    main()
