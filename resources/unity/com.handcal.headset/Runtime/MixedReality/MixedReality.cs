using System;
using System.Diagnostics;
using System.Linq;
using Microsoft.MixedReality.OpenXR;
using UnityEngine;
using UnityEngine.Rendering;

namespace Handcal
{
    /// <summary>
    /// What HoloLens 2 needs under OpenXR: the focus plane of each frame, which
    /// XRDisplaySubsystem.SetFocusPlane does not set there, and the predicted time of display.
    /// </summary>
    static class MixedReality
    {
        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.BeforeSceneLoad)]
        static void Begin()
        {
            Camera.onPostRender += Stabilise;
            RenderPipelineManager.endCameraRendering += (context, camera) => Stabilise(camera);
#if HANDCAL_OPENXR_TIME
            HandcalHeadset.PredictedTimeNs = () => (long)(1e9 / Stopwatch.Frequency * OpenXRTime.Current.ConvertXrTimeToQpcTime(
                OpenXRTime.Current.GetPredictedDisplayTimeInXrTime(FrameTime.OnUpdate)));
#endif
        }

        static void Stabilise(Camera camera)
        {
            var headset = camera.GetComponent<HandcalHeadset>();
            if (headset == null || !headset.enabled || !headset.setsFocusPlane) return;
            headset.FocusPlane(out Vector3 point, out Vector3 normal);
            var settings = new ReprojectionSettings
            {
                ReprojectionMode = ReprojectionMode.PlanarManual,
                ReprojectionPlaneOverridePosition = point,
                ReprojectionPlaneOverrideNormal = normal,
                ReprojectionPlaneOverrideVelocity = Vector3.zero,
            };
            foreach (ViewConfiguration view in ViewConfiguration.EnabledViewConfigurations)
                if (view.IsActive && view.SupportedReprojectionModes.Contains(ReprojectionMode.PlanarManual))
                    view.SetReprojectionSettings(settings);
        }
    }
}
