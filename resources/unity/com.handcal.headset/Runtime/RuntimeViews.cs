using System;
using System.Collections.Generic;
using Handcal.Link;
using UnityEngine;
using UnityEngine.XR;

namespace Handcal
{
    /// <summary>
    /// The eyes' views as the runtime reports them, for the headset's introduction; and what in the
    /// project keeps the calibrated ones from being drawn.
    /// </summary>
    sealed class RuntimeViews
    {
        const double ReportedMoveM = 1e-4, ReportedTangent = 1e-4, WarnedMoveM = 5e-4, PeriodS = 1;
        readonly Camera camera;
        readonly List<InputDevice> devices = new List<InputDevice>();
        List<View> views = new List<View>(), reported = new List<View>(), first;
        double nextS;

        public RuntimeViews(Camera camera)
        {
            this.camera = camera;
        }

        /// <summary>The setting of the project, or another reason, that keeps calibrations from being drawn; empty if there is none.</summary>
        public string ProjectFault { get; private set; } = "";

        /// <summary>Says that the runtime moves its view; empty if it does not.</summary>
        public string Movement { get; private set; } = "";

        /// <summary>Checks the project. Scriptable pipelines call neither OnPreCull nor OnPreRender: do it in Update.</summary>
        public void CheckProject()
        {
            if (HandcalHeadset.Native != null)
            {
                ProjectFault = HandcalHeadset.Native.Refusal;
                return;
            }
            XRDisplaySubsystem display = EyeCameras.Display();
            bool isSinglePass = false;
            for (int i = 0; display != null && i < display.GetRenderPassCount(); i++)
            {
                display.GetRenderPass(i, out XRDisplaySubsystem.XRRenderPass pass);
                isSinglePass |= pass.GetRenderParameterCount() > 1;
            }
            if (isSinglePass)
                ProjectFault = "The project renders in a single pass, which ignores calibrated projections: "
                    + "set XR Plug-in Management > Render Mode to Multi Pass.";
            if (UnityEngine.Rendering.GraphicsSettings.currentRenderPipeline != null)
                ProjectFault = "The project uses a scriptable render pipeline, which ignores calibrated projections: "
                    + "clear Project Settings > Graphics and the pipelines of Quality.";
        }

        /// <summary>Reads the runtime's views; call before they are overridden.</summary>
        public void Read()
        {
            if (!camera.stereoEnabled || Time.realtimeSinceStartup < nextS) return;
            nextS = Time.realtimeSinceStartup + PeriodS;
            List<View> found = HandcalHeadset.Native == null ? new List<View>() : HandcalHeadset.Native.Own();
            XRDisplaySubsystem display = EyeCameras.Display();
            int eyes = 0;
            for (int i = 0; display != null && i < display.GetRenderPassCount(); i++)
            {
                display.GetRenderPass(i, out XRDisplaySubsystem.XRRenderPass pass);
                for (int k = 0; k < pass.GetRenderParameterCount() && eyes < 2; k++)
                {
                    // Not the camera's: that may return what was set, and at first the identity.
                    pass.GetRenderParameter(camera, k, out XRDisplaySubsystem.XRRenderParameter eye);
                    RenderTextureDescriptor size = pass.renderTargetDesc;
                    if (HandcalHeadset.Native != null)
                    {
                        if (eyes < found.Count) found[eyes].WidthPx = size.width;
                        if (eyes < found.Count) found[eyes].HeightPx = size.height;
                        eyes++;
                    }
                    else if (eyes++ == 0)
                        AddView(found, Eyes.Left, eye.projection, size, CommonUsages.leftEyePosition, CommonUsages.leftEyeRotation);
                    else
                        AddView(found, Eyes.Right, eye.projection, size, CommonUsages.rightEyePosition, CommonUsages.rightEyeRotation);
                }
            }
            if (eyes == 0) found.Clear();
            views = found;
            if (found.Count < 2) return;
            first = first ?? found;
            double movedM = Moved(first, found);
            if (movedM > WarnedMoveM && Movement.Length == 0)
                Movement = "The runtime has moved its view by " + (1000 * movedM).ToString("0.0")
                    + " mm since the start. handcal draws with the rig's view; switch the runtime's own "
                    + "calibration off if you can.";
        }

        /// <summary>True if the views have changed since the last introduction.</summary>
        public bool HasChanged()
        {
            bool isOther = views.Count != reported.Count || Moved(reported, views) > ReportedMoveM;
            for (int i = 0; !isOther && i < views.Count; i++)
                for (int edge = 0; edge < 4; edge++)
                    isOther |= Math.Abs(views[i].Tangents[edge] - reported[i].Tangents[edge]) > ReportedTangent;
            return isOther;
        }

        public Device Introduction(string name, double eyeDistanceM)
        {
            reported = views;
            XRDisplaySubsystem display = EyeCameras.Display();
            return new Device
            {
                Name = name.Length > 0 ? name : DeviceName(),
                Runtime = (display == null ? "no headset" : Id(display)) + " " + SystemInfo.operatingSystem,
                App = Application.productName + " " + Application.version,
                Views = views,
                EyeDistanceM = eyeDistanceM,
            };
        }

        static string Id(XRDisplaySubsystem display)
        {
#if UNITY_2020_2_OR_NEWER
            return display.subsystemDescriptor.id;
#else
            return display.SubsystemDescriptor.id;
#endif
        }

        /// <summary>The device's own name, or on Android, which may not tell it, its model.</summary>
        static string DeviceName()
        {
            string name = SystemInfo.deviceName;
            return name.Length == 0 || name == "<unknown>" || name == "n/a" ? SystemInfo.deviceModel : name;
        }

        void AddView(
            List<View> into, Eyes eye, Matrix4x4 projection, RenderTextureDescriptor size,
            InputFeatureUsage<Vector3> position, InputFeatureUsage<Quaternion> rotation)
        {
            devices.Clear();
            InputDevices.GetDevicesAtXRNode(XRNode.Head, devices);
            foreach (InputDevice head in devices)
            {
                bool isKnown = head.TryGetFeatureValue(position, out Vector3 eyeAt)
                    & head.TryGetFeatureValue(rotation, out Quaternion eyeTurn)
                    & head.TryGetFeatureValue(CommonUsages.centerEyePosition, out Vector3 headAt)
                    & head.TryGetFeatureValue(CommonUsages.centerEyeRotation, out Quaternion headTurn);
                bool isPerspective = projection[3, 2] != 0 && projection[0, 0] != 0 && projection[1, 1] != 0;
                if (!isKnown || !isPerspective) continue;
                double[] TVW = Matrices.Invert(Pose(eyeAt, eyeTurn));
                into.Add(new View
                {
                    Eye = eye,
                    TVH = Matrices.Multiply(TVW, Pose(headAt, headTurn)),
                    Tangents = Tangents(projection),
                    WidthPx = Math.Max(1, size.width),
                    HeightPx = Math.Max(1, size.height),
                });
                return;
            }
        }

        static double[] Pose(Vector3 p, Quaternion q)
        {
            return Matrices.FromUnity(p.x, p.y, p.z, q.x, q.y, q.z, q.w);
        }

        /// <summary>Left, right, up and down edge of a projection: x/z or y/z with y down.</summary>
        internal static double[] Tangents(Matrix4x4 m)
        {
            return new double[]
            {
                (m[0, 2] - 1) / m[0, 0], (m[0, 2] + 1) / m[0, 0],
                -(m[1, 2] + 1) / m[1, 1], (1 - m[1, 2]) / m[1, 1],
            };
        }

        static double Moved(List<View> before, List<View> now)
        {
            double most = 0;
            for (int i = 0; i < Math.Min(before.Count, now.Count); i++)
                most = Math.Max(most, Distance(before[i].TVH, now[i].TVH));
            return most;
        }

        static double Distance(double[] TVH, double[] other)
        {
            double[] eye = Matrices.Invert(TVH), otherEye = Matrices.Invert(other);
            double x = eye[3] - otherEye[3], y = eye[7] - otherEye[7], z = eye[11] - otherEye[11];
            return Math.Sqrt(x * x + y * y + z * z);
        }
    }
}
