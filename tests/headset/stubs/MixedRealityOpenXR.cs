// The part of the Mixed Reality OpenXR Plugin 1.11 that the package uses; see UnityEngine.cs.
using System.Collections.Generic;
using System.Diagnostics;
using UnityEngine;

namespace Microsoft.MixedReality.OpenXR
{
    public enum ReprojectionMode { Depth = 1, PlanarFromDepth = 2, PlanarManual = 3, OrientationOnly = 4, NoReprojection = -1 }

    public struct ReprojectionSettings
    {
        public ReprojectionMode ReprojectionMode { get; set; }
        public Vector3? ReprojectionPlaneOverridePosition, ReprojectionPlaneOverrideNormal, ReprojectionPlaneOverrideVelocity;
    }

    public struct ViewConfiguration
    {
        /// <summary>Of the present frame.</summary>
        public static ReprojectionSettings StubSettings;
        public static IReadOnlyList<ViewConfiguration> EnabledViewConfigurations { get { return new ViewConfiguration[1]; } }
        public bool IsActive { get { return true; } }
        public IReadOnlyList<ReprojectionMode> SupportedReprojectionModes { get { return new[] { ReprojectionMode.PlanarManual }; } }
        public void SetReprojectionSettings(ReprojectionSettings settings) { StubSettings = settings; }
    }

    public enum FrameTime { OnUpdate, OnRender }

    public class OpenXRTime
    {
        public static readonly OpenXRTime Current = new OpenXRTime();

        /// <summary>From now to the display, ns; 0: not known.</summary>
        public static long StubAheadNs;
        public long GetPredictedDisplayTimeInXrTime(FrameTime frameTime) { return StubAheadNs == 0 ? 0 : StubAheadNs + (long)(Stopwatch.GetTimestamp() * (1e9 / Stopwatch.Frequency)); }
        public long ConvertXrTimeToQpcTime(long xrTime) { return (long)(xrTime * (Stopwatch.Frequency / 1e9)); }
    }
}
