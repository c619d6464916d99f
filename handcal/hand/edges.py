"""The edges of near surfaces in a rig's depth image, beside the true ones."""

from __future__ import annotations

from handcal.core.types import DepthEdges, Rig

_STEREO = DepthEdges(fatten_px=1.8, sigma_px=0.7, source="typical")
"""Active stereo: half of the matching window, 1 to 3 px on a D4xx; 1.0 to 2.4 px, 1.8 in the mean,
in the real frames of docs/segmentation.md."""
_TIME_OF_FLIGHT = DepthEdges(fatten_px=-0.5, sigma_px=0.5, source="typical")
"""Without matching windows the centres of the outermost pixels lie half a pixel inside. One that
sees both surfaces has a depth between them and may be left out, which is half a pixel either way:
a millimetre for their coarse images."""
_STRUCTURED_LIGHT = DepthEdges(fatten_px=-0.5, sigma_px=1.0, source="typical")
"""Each pixel decodes the pattern alone, but the projector's shadow and the blur of its stripes
remove or add a pixel."""
_UNKNOWN = DepthEdges(fatten_px=1.8, sigma_px=0.8, source="typical")
"""Most likely a stereo camera."""

_BY_MODEL = {
    "simulated camera": _STEREO,  # as the D415 on which it is modelled, whatever it simulates
    "realsense d4": _STEREO,
    "oak": _STEREO,
    "gemini": _STEREO,
    "hololens": _TIME_OF_FLIGHT,
    "ahat": _TIME_OF_FLIGHT,
    "azure kinect": _TIME_OF_FLIGHT,
    "femto": _TIME_OF_FLIGHT,
    "l515": _TIME_OF_FLIGHT,
    "sr30": _STRUCTURED_LIGHT,
}


def edges_of(rig: Rig, live_model: str = "") -> DepthEdges:
    """Return the measured edges of a rig's depth camera, or those typical of its model.

    Parameters
    ----------
    rig : Rig
    live_model : str
        Model of the connected camera, for a rig that names none.
    """
    if rig.depth_edges is not None:
        return rig.depth_edges
    model = (rig.depth_camera.model or live_model).lower()
    return next((edges for part, edges in _BY_MODEL.items() if part in model), _UNKNOWN)
