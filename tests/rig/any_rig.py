"""Strategy of hypothesis for every rig that can be written."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from handcal.core.geometry import rigid
from handcal.core.types import (
    EYES,
    RIG_PARTS,
    CameraIdentity,
    DepthCheck,
    DepthEdges,
    EyeDisplay,
    HeadsetIdentity,
    HeadsetView,
    Intrinsics,
    Origin,
    Rig,
)

OFFSET = st.floats(-0.05, 0.05)
VECTORS = st.tuples(OFFSET, OFFSET, OFFSET)
TRANSFORMS = st.builds(rigid, st.tuples(*[st.floats(-3, 3)] * 3), VECTORS)
VIEWS = st.builds(rigid, st.tuples(*[st.floats(-0.8, 0.8)] * 3), VECTORS)
SIDE = st.integers(1, 16384)
FOCAL_SIDES, AXIS_SHARE = st.floats(0.32, 5.0), st.floats(0.2, 0.8)  # 11° to 115° across
DISPLAYS = st.builds(
    lambda side, f, c, **others: EyeDisplay(
        K=np.array([[f * side, 0, c * side], [0, f * side, c * side], [0, 0, 1]]),
        width_px=side,
        height_px=side,
        **others,
    ),
    SIDE.filter(lambda side: side > 4),  # focal lengths are at least a pixel
    FOCAL_SIDES,
    AXIS_SHARE,
    H0=st.builds(lambda x: np.array([[1 + x, 0, x], [0, 1 - x, x], [0, 0, 1]]), OFFSET),
    t_C0_V_m=VECTORS,
    z_C0_S_m=st.floats(0.1, 100),
    T_V_H=VIEWS,
)
LINES = st.text(st.characters(categories=["L", "N", "P"]), min_size=1, max_size=40)
ORIGINS = st.builds(
    Origin,
    method=LINES,
    made=st.just("2026-11-21T16:00:00+00:00"),
    views=st.integers(1, 500),
    rms_px=st.floats(0, 10),
    verdict=st.sampled_from(["good", "needs more views", "bad"]),
    reason=LINES,
    parameters=st.just(("x_m", "turn: rad")),
    covariance=st.builds(lambda a, b: np.array([[a, b], [b, a]]), st.floats(0, 1), OFFSET),
)
CHARACTERS = st.characters(categories=["L", "N", "P", "S"], include_characters=" ")
MAY_BE_EMPTY = LINES | st.just("")
HEADSETS = st.builds(
    HeadsetIdentity,
    device_id=st.text("0123456789abcdefABCDEF", min_size=1, max_size=128),
    name=MAY_BE_EMPTY,
    runtime=MAY_BE_EMPTY,
    app=MAY_BE_EMPTY,
    protocol=st.integers(0, 2**16 - 1),
    views=st.dictionaries(
        st.sampled_from(EYES),
        st.builds(
            lambda T, low, high, side: HeadsetView(T, np.array([low, high] * 2), side, side),
            *(VIEWS, st.floats(-2, -1), st.floats(1, 2), SIDE),
        ),
    ),
    eye_distance_m=st.none() | st.floats(0.03, 0.1),
)
CHECKS = st.builds(
    lambda edges_m, values: DepthCheck(
        made="2026-11-23",
        views=1 + len(edges_m),
        scale=1.0 + values[0],
        offset_m=values[1],
        covariance=np.diag(np.abs(values[:2])),
        ranges_m=np.sort(edges_m).reshape(-1, 2),
        flatness_m=np.full(len(edges_m) // 2, abs(values[2])),
        flatness_sigma_m=np.full(len(edges_m) // 2, abs(values[0])),
    ),
    st.integers(1, 20).flatmap(
        lambda n: st.lists(st.floats(0, 10), min_size=2 * n, max_size=2 * n)
    ),
    VECTORS,
)
EDGES = st.builds(
    DepthEdges,
    fatten_px=st.floats(-20.0, 20.0),
    sigma_px=st.floats(1e-3, 20.0),
    source=st.just("measured"),
    views=st.integers(1, 500),
    made=st.just("2026-11-28T13:00:00+00:00"),
)
RIGS = st.builds(
    Rig,
    name=st.text(CHARACTERS, min_size=1, max_size=200)
    | st.sampled_from(["true", "null", "12", '"quoted"', "'quoted'", "back\\slash", " end "]),
    eyes=st.fixed_dictionaries({"left": DISPLAYS, "right": DISPLAYS}),
    T_H_D=TRANSFORMS,
    depth_intrinsics=st.builds(
        lambda side, f, aspect, c, d, distortion: Intrinsics(
            side, side, f * side, aspect * f * side, c * side, d * side, distortion
        ),
        SIDE,
        FOCAL_SIDES,
        st.floats(0.9, 1.1),
        AXIS_SHARE,
        AXIS_SHARE,
        distortion=st.sampled_from([0, 4, 5, 8, 12, 14]).flatmap(
            lambda n: st.tuples(*[st.floats(-10, 10)] * n)
        ),
    ),
    origins=st.dictionaries(st.sampled_from(RIG_PARTS), ORIGINS),
    depth_camera=st.builds(CameraIdentity, MAY_BE_EMPTY, MAY_BE_EMPTY, MAY_BE_EMPTY),
    headset=st.none() | HEADSETS,
    depth_check=st.none() | CHECKS,
    depth_edges=st.none() | EDGES,
)
