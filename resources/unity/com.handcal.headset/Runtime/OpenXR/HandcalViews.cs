using System;
using System.Collections.Generic;
using System.Globalization;
using System.Runtime.InteropServices;
using Handcal.Link;
using UnityEngine;
using UnityEngine.XR.OpenXR.Features;
#if UNITY_EDITOR
using UnityEditor;
using UnityEditor.XR.OpenXR.Features;
#endif

namespace Handcal
{
    /// <summary>
    /// Gives Unity the calibrated views and the runtime its own, between Unity's OpenXR plug-in and
    /// the runtime; resources/openxr/unity.c, built for the platform, does it.
    /// </summary>
#if UNITY_EDITOR
    [OpenXRFeature(
        UiName = "handcal calibrated views", Company = "handcal", Version = "0.2.0", FeatureId = Id,
        Desc = "Draws each eye with its calibration, in every render pipeline and mode.",
        OpenxrExtensionStrings = "XR_KHR_win32_convert_performance_counter_time XR_KHR_convert_timespec_time",
        BuildTargetGroups = new[] { BuildTargetGroup.Standalone, BuildTargetGroup.WSA, BuildTargetGroup.Android })]
#endif
    public sealed class HandcalViews : OpenXRFeature, INativeViews
    {
        public const string Id = "com.handcal.headset.views";
        const string Library = "handcal_openxr";
        const int OwnNumbers = 11;

        [Tooltip("The runtime moves its views with the wearer's eyes, as HoloLens 2 and Magic Leap 2 do.")]
        public bool movesViews;

        HeadsetState calibrated;
        int shownState;
        bool isHooked, isExpressed = true;

        public string Refusal { get; private set; } = "";

        protected override IntPtr HookGetInstanceProcAddr(IntPtr func)
        {
            try
            {
                IntPtr hook = handcal_unity_hook(func);
                isHooked = true;
                return hook;
            }
            catch (Exception error) when (error is TypeLoadException || error is BadImageFormatException)
            {
                Debug.LogWarning("handcal: the library " + Library + " is missing or of another platform: "
                    + "build it as the package's manual says. " + error.Message);
                return func;
            }
        }

        protected override void OnSessionCreate(ulong xrSession)
        {
            if (!isHooked) return;
            HandcalHeadset.Native = this;
            HandcalHeadset.PredictedTimeNs = () => HandcalHeadset.Native == null ? 0 : handcal_unity_display_time_ns();
        }

        protected override void OnSessionDestroy(ulong xrSession)
        {
            HandcalHeadset.Native = null;
        }

        public void Calibrate(HeadsetState state)
        {
            ShowRefusal();
            if (state == calibrated) return;
            calibrated = state;
            double[] left = Eye(state?.Left, state), right = Eye(state?.Right, state);
            isExpressed = state?.Left == null || state.Right == null || left != null && right != null;
            double[] both = null;
            if (left != null && right != null)
            {
                both = new double[left.Length + right.Length];
                left.CopyTo(both, 0);
                right.CopyTo(both, left.Length);
            }
            handcal_unity_calibrate(both, movesViews ? 1 : 0);
        }

        public List<View> Own()
        {
            var found = new List<View>();
            var own = new float[2 * OwnNumbers];
            if (handcal_unity_own(own) == 0) return found;
            for (int at = 0; at < own.Length; at += OwnNumbers)
                found.Add(new View
                {
                    Eye = at == 0 ? Eyes.Left : Eyes.Right,
                    // From OpenXR's axes by Unity's, whose z points forward.
                    TVH = Matrices.Invert(Matrices.FromUnity(
                        own[at + 4], own[at + 5], -own[at + 6], -own[at], -own[at + 1], own[at + 2], own[at + 3])),
                    Tangents = new[]
                    {
                        Math.Tan(own[at + 7]), Math.Tan(own[at + 8]), -Math.Tan(own[at + 9]), -Math.Tan(own[at + 10]),
                    },
                });
            return found;
        }

        static double[] Eye(Projection one, HeadsetState state)
        {
            return one == null ? null : Matrices.OpenXr(one.Drawn(state.IsOffline), one.TVH, one.WidthPx, one.HeightPx);
        }

        /// <summary>Says why the library refuses, by views.h's HandcalState, once for each reason.</summary>
        void ShowRefusal()
        {
            int state = handcal_unity_state(out double measured);
            if (!isExpressed) state = -1;
            if (state == shownState) return;
            shownState = state;
            string off = measured.ToString("0.0", CultureInfo.InvariantCulture);
            Refusal = state == -1 ? "This calibration has skew, with which OpenXR cannot draw."
                : state == 3 ? "The headset's views are " + off + " mm from where the rig has them: turn its eye distance "
                    + "back, or calibrate the rig again."
                : state == 4 ? "The headset's views look " + off + " mrad from where the rig has them: calibrate the rig again."
                : state == 5 ? "The headset's field of view is not the rig's: this calibration is of another headset."
                : state == 6 ? "The headset's four views are not as handcal knows them: use two."
                : "";
        }

        [DllImport(Library)]
        static extern IntPtr handcal_unity_hook(IntPtr next);

        [DllImport(Library)]
        static extern void handcal_unity_calibrate(double[] eyes, int movesViews);

        [DllImport(Library)]
        static extern int handcal_unity_state(out double measured);

        [DllImport(Library)]
        static extern int handcal_unity_own(float[] to);

        [DllImport(Library)]
        static extern long handcal_unity_display_time_ns();
    }
}
