"""Definitions of the words and symbols of the report."""

DEFINITIONS = {
    "φ = (φ₁, φ₂, φ₃)": (
        "Position of the wearer's eye relative to the viewpoint camera of the offline calibration: "
        "right, down and forward, along the axes of E."
    ),
    "± σ": (
        "One standard deviation, from the covariance's diagonal. For the method “consistent” it "
        "covers the registration and, if fused, how precisely people align. For an alignment by "
        "another method it is plain least squares with independent pairs, which is optimistic."
    ),
    "solved": (
        "All alignments and verifications combined, weighted by their covariances, with the prior: "
        "the size of the eye box, and how far the φ of the two eyes differ."
    ),
    "final, applied": (
        "The final φ of an eye is the one that the headset draws with, or will once it is sent: "
        "solved, offline (zero), set by hand, or earlier (of results before the newest). It is "
        "applied if the headset acknowledged it and rendered with it at the end."
    ),
    "verdict": (
        "Good: accepted. Not yet: more alignments or verifications are needed. No better than "
        "before: the offline calibration is kept. Impossible: the eye would lie where no eye is. "
        "Contradicted: camera, headset or rig speak against the result. In CSV and JSON: accept, "
        "repeat, keep, implausible, contradicted."
    ),
    "expected error": (
        "Error in the display that φ's covariance predicts: mean over the corners of an 8 cm "
        "square straight ahead at 0.4, 0.5 and 0.6 m, in arcminutes (′, a sixtieth of a degree)."
    ),
    "error in depth": (
        "Distance along the viewing direction by which an object at 0.5 m must move to cover its "
        "drawing: expected without the calibration → with it."
    ),
    "eye distance": "Distance between the two solved eyes, from φ and the rig.",
    "residual, RMS": (
        "Distance of a hand point to its partner on the cursor after registration; RMS over the "
        "inliers of all alignments."
    ),
    "inliers": (
        "Share of the hand's points whose partner is near, and not beside a cut edge such as the "
        "forearm's."
    ),
    "rotation": "Angle between the hand and the cursor at the confirmation.",
    "reprojection error": (
        "In the user test: distance in the display between a corner of the target drawn with the "
        "calibrated φ (the solved one, or 0 for an eye that keeps the offline calibration) and "
        "with the φ that was adjusted by hand until the drawn target covered the real one."
    ),
    "W, H, D": "Frames: the world, the headset's rig, the depth camera.",
    "C0, C1": "The viewpoint of the offline calibration, and the wearer's eye.",
    "E, S, V": (
        "The ideal on-axis eye-display camera at C0, the display's focal plane, and the headset's "
        "rendering camera. Axes: x right, y down, z forward."
    ),
    "method": (
        "Hu, Rodriguez y Baena, Cutolo: Rotation-constrained optical see-through headset "
        "calibration with bare-hand alignment. ISMAR 2021. “paper” is its solver as published; "
        "“linear” the same model with all equations of each pair; “consistent” the exact model, "
        "robust to cut edges and a rotated hand; “icp” the rigid baseline."
    ),
}
