using System;
using System.Collections.Concurrent;
using System.Diagnostics;
using System.Threading.Tasks;
using Handcal.Link;
using UnityEngine;
using Debug = UnityEngine.Debug;

namespace Handcal
{
    /// <summary>
    /// Makes the headset's camera one that handcal calibrates: it connects to the PC, sends poses,
    /// draws each eye with its calibrated projection and the rig's view, shows what the PC asks
    /// for, and confirms. In the built-in render pipeline and multi-pass; with HandcalViews in all.
    /// </summary>
    [RequireComponent(typeof(Camera))]
    [DisallowMultipleComponent]
    [AddComponentMenu("handcal/handcal headset")]
    public sealed class HandcalHeadset : MonoBehaviour
    {
        [Tooltip("The text under the PC's QR code (handcal pair), or its address and 8 digits, as "
            + "192.168.1.20 12345678. Used once; afterwards the app connects as paired, until you enter another text.")]
        public string invitation = "";

        [Tooltip("Name by which the PC calls this headset. Empty: the device's own.")]
        public string deviceName = "";

        [Tooltip("Time from the camera's pose to its display, ms, if neither the runtime nor the app tells the time of display.")]
        public float poseDelayMs;

        [Tooltip("Stabilise the picture at the virtual image, where reprojection does not reduce the correction.")]
        public bool setsFocusPlane = true;

        [Tooltip("Distance of the virtual image, m, until the calibration provides it.")]
        public float focusDistanceM = 2;

        [Tooltip("The wearer's eye distance, mm, if it is measured, for example by eye tracking. 0: not measured.")]
        public float eyeDistanceMm;

        [Tooltip("Show prompts and the state of the connection in front of the wearer.")]
        public bool showsText = true;

        [Tooltip("Spoken word that confirms (Windows devices, with the Microphone capability). Empty: none.")]
        public string confirmWord = "confirm";

        /// <summary>
        /// The time that the camera's present pose is for, ns on <see cref="NowNs"/>'s clock: the
        /// predicted time of display. Null: as the runtime predicts it, else now + poseDelayMs.
        /// </summary>
        public Func<long> PoseTimeNs;

        /// <summary>The same of the runtime, set by the package's part for a plug-in; 0: not known.</summary>
        public static Func<long> PredictedTimeNs = () => 0;

        /// <summary>The part that draws with the calibration below Unity; null: the camera's matrices are set.</summary>
        public static INativeViews Native;

        const string HowToPair = "On the PC, run handcal pair. Then scan its QR code, or type its address "
            + "and the 8 digits, as 192.168.1.20 12345678";
        const double PairPatienceS = 5;
        const float GreetingS = 3;
        readonly ConcurrentQueue<Action> agreed = new ConcurrentQueue<Action>();  // from another thread
        HeadsetLink link;
        PairingFile pairing;
        HeadsetState drawn = new HeadsetState();
        EyeCameras cameras;
        Drawing drawing;
        Presses presses;
        RuntimeViews views;
        NudgeSum moved;
        uint movedId;
        string pairingProblem = "", warning = "", fault = "";
        int pairings;  // that go on
        float connectedS = float.NegativeInfinity;
        bool wasConnected;

        /// <summary>The state that is drawn.</summary>
        public HeadsetState State { get { return drawn; } }

        /// <summary>The wearer whose calibration is drawn with; empty if there is none.</summary>
        public string Wearer { get { return drawn.Wearer; } }

        public bool IsPaired { get { return pairing != null && pairing.IsPaired; } }

        /// <summary>True while digits are agreed on with the PC.</summary>
        public bool IsPairing { get { return pairings > 0; } }

        /// <summary>The reason why the last pairing failed; empty if it did not.</summary>
        public string PairingProblem { get { return pairingProblem; } }

        public bool IsConnected { get { return link != null && link.IsConnected; } }

        /// <summary>The fault that keeps the calibration from being drawn as it should; empty if there is none.</summary>
        public string Warning { get { return warning; } }

        /// <summary>
        /// The prompt; a setting of the project that makes calibrations worthless; or without a
        /// connection its state, and whose calibration is shown.
        /// </summary>
        public string Text
        {
            get
            {
                if (views != null && views.ProjectFault.Length > 0) return views.ProjectFault;
                bool isNew = Time.realtimeSinceStartup < connectedS + GreetingS;
                if (IsConnected) return drawn.Prompt.Length == 0 && isNew ? "Connected to the PC" : drawn.Prompt;
                string whose = drawn.Left == null && drawn.Right == null
                    ? "" : "\nShowing the calibration of " + drawn.Wearer + ", rig " + drawn.Rig;
                if (IsPairing) return "Pairing…";
                if (pairingProblem.Length > 0) return pairingProblem + whose;
                if (!IsPaired) return HowToPair + whose;
                return (link != null && link.Problem.Length > 0 ? link.Problem : "Waiting for the PC") + whose;
            }
        }

        /// <summary>Distance of the virtual image, for the compositor's focus plane, m.</summary>
        public float FocusDistanceM
        {
            get
            {
                Projection one = drawn.Left ?? drawn.Right;
                double foundM = one == null
                    ? 0 : Matrices.FocusDistanceM(one.P, one.POffline, one.WidthPx, one.HeightPx);
                return foundM > 0.1 ? (float)foundM : focusDistanceM;
            }
        }

        /// <summary>
        /// The plane of the virtual image, in the world: where the compositor should stabilise the
        /// picture. The component sets it where XRDisplaySubsystem.SetFocusPlane does.
        /// </summary>
        public void FocusPlane(out Vector3 point, out Vector3 normal)
        {
            cameras.FocusPlane(FocusDistanceM, out point, out normal);
        }

        /// <summary>The headset's clock, ns.</summary>
        public static long NowNs()
        {
            return (long)(Stopwatch.GetTimestamp() * (1e9 / Stopwatch.Frequency));
        }

        /// <summary>
        /// Pairs with the PC by the text of its QR code, scanned or typed; or by its address and the
        /// 8 digits that it shows, "192.168.1.20 12345678". False if the text is neither, or the
        /// component is disabled. It takes a moment: see IsPairing and PairingProblem.
        /// </summary>
        public bool Pair(string text)
        {
            if (drawing == null) return false;
            string host = "", digits = "";
            int port = 0;
            bool isScanned = Invitation.TryRead(text, out Invitation scanned);
            if (!isScanned && !Invitation.TrySplitTyped(text, out host, out port, out digits))
            {
                FailPairing("\"" + text + "\" is not understood. " + HowToPair);
                return false;
            }
            if (isScanned)
            {
                host = scanned.Host;
                port = scanned.Port;
            }
            ulong device = pairing.DeviceId;
            string name = Introduction().Name;
            pairings++;
            Task.Run(() =>
            {
                byte[] key = null;
                string problem;
                try
                {
                    key = isScanned
                        ? Exchange.PairByCode(scanned, device, name, PairPatienceS, out problem)
                        : Exchange.PairByDigits(host, port, digits, device, name, PairPatienceS, out problem);
                }
                catch (Exception error)  // of a name that is none
                {
                    problem = "The PC at " + host + " cannot be reached: " + error.Message;
                }
                agreed.Enqueue(() =>
                {
                    pairings--;
                    if (key == null) FailPairing(problem);
                    else Paired(host, port, key);
                });
            });
            return true;
        }

        /// <summary>The wearer says that the hand covers the cursor, or the outline when verifying.</summary>
        public void Confirm()
        {
            ConfirmAt(NowNs());
        }

        /// <summary>Moves the drawing of the eye that is verified by some steps, each way ±1.</summary>
        public void Nudge(int right, int down, int larger)
        {
            if (link == null || drawn.Verify == null) return;
            moved = Moved().Plus(drawn.Verify, right, down, larger);
            link.Nudge(NowNs(), drawn, moved, false);
        }

        /// <summary>The wearers whose calibrations this headset keeps, the newest first.</summary>
        public string[] KeptWearers()
        {
            return link == null ? new string[0] : link.KeptWearers();
        }

        /// <summary>Draws with a kept calibration until the PC sends another; false if there is none.</summary>
        public bool ShowKept(string wearer)
        {
            return link != null && link.ShowKept(wearer);
        }

        // handcal's layer would correct a second time; before Unity loads OpenXR, with which it would come.
        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.SubsystemRegistration)]
        static void SwitchLayerOff()
        {
            Environment.SetEnvironmentVariable("HANDCAL_OPENXR_OFF", "1");
        }

        void OnEnable()
        {
            var eyes = GetComponent<Camera>();
            pairing = new PairingFile(Application.persistentDataPath);
            cameras = new EyeCameras(eyes);
            drawing = new Drawing(transform);
            presses = new Presses(confirmWord, ConfirmAt);
            views = new RuntimeViews(eyes);
            Application.onBeforeRender += SendPose;
            if (pairing.Problem.Length > 0) Warn(pairing.Problem);
            Connect();
            if (invitation.Length > 0 && invitation != pairing.UsedInvitation) Pair(invitation);
        }

        void OnDisable()
        {
            Application.onBeforeRender -= SendPose;
            Disconnect();
            presses.Dispose();
            drawing.Dispose();
            drawing = null;
            cameras.Reset();
            Native?.Calibrate(null);
        }

        void OnTransformParentChanged()
        {
            if (drawing != null) drawing.Parent = transform.parent;
        }

        void Update()
        {
            while (agreed.TryDequeue(out Action connect)) connect();
            if (Native != null) views.Read();
            views.CheckProject();
            if (views.ProjectFault != fault)
            {
                fault = views.ProjectFault;
                if (fault.Length > 0) Warn(fault);
                else warning = "";
            }
            if (views.Movement.Length > 0 && warning.Length == 0) Warn(views.Movement);
            if (IsConnected && !wasConnected) connectedS = Time.realtimeSinceStartup;
            wasConnected = IsConnected;
            if (link == null)
            {
                drawing.Show(drawn, showsText ? Text : "");
                return;
            }
            if (presses.Read())  // of what the last frame showed
            {
                if (presses.Right != 0 || presses.Down != 0 || presses.Larger != 0)
                    Nudge(presses.Right, presses.Down, presses.Larger);
                if (presses.IsConfirmed) Confirm();
            }
            drawn = link.State();
            Native?.Calibrate(drawn);
            byte[] kept = link.TakeKept();
            if (kept != null && !pairing.StoreKept(kept)) Warn(pairing.Problem);
            if (views.HasChanged()) link.SetDevice(Introduction());
            drawing.Show(drawn, showsText ? Text : "");
        }

        // After every script that moves the camera.
        [BeforeRenderOrder(30000)]
        void SendPose()
        {
            if (link == null) return;
            // In the space of the camera's parent, in which everything is drawn as well.
            Vector3 p = transform.localPosition;
            Quaternion q = transform.localRotation;
            long timeNs = (PoseTimeNs ?? PredictedTimeNs)();
            if (timeNs == 0) timeNs = NowNs() + (long)(1e6 * poseDelayMs);
            link.SendPose(Matrices.FromUnity(p.x, p.y, p.z, q.x, q.y, q.z, q.w), timeNs);
        }

        void OnPreCull()
        {
            if (Native == null)
            {
                cameras.Reset();
                views.Read();
                cameras.Apply(drawn);
            }
            if (!setsFocusPlane) return;
            FocusPlane(out Vector3 point, out Vector3 normal);
            EyeCameras.Display()?.SetFocusPlane(point, normal, Vector3.zero);
        }

        void OnPreRender()
        {
            if (Native == null) drawing.BeginEye(cameras.ActiveEye);
        }

        void ConfirmAt(long timeNs)
        {
            if (link == null) return;
            if (drawn.Verify != null) link.Nudge(timeNs, drawn, Moved(), true);
            else if (drawn.Cursor != null && drawn.Cursor.Points.Count > 0) link.Confirm(timeNs, drawn);
        }

        /// <summary>The nudges of the present verification; a new one begins at zero.</summary>
        NudgeSum Moved()
        {
            if (movedId != drawn.Verify.Id) moved = new NudgeSum();
            movedId = drawn.Verify.Id;
            return moved;
        }

        void Connect()
        {
            Disconnect();
            if (!pairing.TryReadKept(out Kept kept)) Warn(pairing.Problem);
            if (!pairing.IsPaired && kept.Count == 0) return;
            // Without a pairing nobody is called, but the kept calibration is drawn.
            link = new HeadsetLink(
                pairing.Host, pairing.Port, pairing.Key, pairing.DeviceId, Introduction(), kept, NowNs);
        }

        void Paired(string host, int port, byte[] key)
        {
            pairingProblem = "";
            if (!pairing.Store(host, port, key, invitation)) Warn(pairing.Problem);
            Connect();
        }

        void FailPairing(string problem)
        {
            pairingProblem = problem;
            Debug.LogWarning("handcal: " + problem, this);
        }

        Device Introduction()
        {
            return views.Introduction(deviceName, 0.001 * eyeDistanceMm);
        }

        void Disconnect()
        {
            if (link == null) return;
            link.Dispose();
            link = null;
        }

        void Warn(string text)
        {
            warning = text;
            Debug.LogWarning("handcal: " + text, this);
        }
    }
}
