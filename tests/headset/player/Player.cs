using System;
using System.Collections.Generic;
using System.Globalization;
using System.Linq;
using System.Reflection;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using UnityEngine;
using UnityEngine.XR;
using Handcal;

namespace Handcal.Tests
{
    /// <summary>
    /// Plays the sample's scene on the stubs of Unity: calls what Unity would call in a frame, in
    /// its order, and tells what is drawn. Each line of the input is an order.
    /// </summary>
    static class Player
    {
        static readonly List<MonoBehaviour> Started = new List<MonoBehaviour>();
        static readonly List<MonoBehaviour> Behaviours = new List<MonoBehaviour>();
        static readonly Matrix4x4[] Projections = new Matrix4x4[2], Views = new Matrix4x4[2];
        static readonly string[] Hidden = { "", "" };
        static readonly float[] NativeViews = new float[66];
        static IntPtr hook;
        static Camera camera;
        static HandcalHeadset headset;

        /// <summary>Arguments: the app's folder, and fields of the headset as name=value.</summary>
        static void Main(string[] arguments)
        {
            CultureInfo.CurrentCulture = new CultureInfo("de-DE");  // a decimal comma changes nothing
            Application.persistentDataPath = arguments[0];
            const BindingFlags Static = BindingFlags.Static | BindingFlags.NonPublic;
            foreach (MethodInfo one in typeof(HandcalHeadset).Assembly.GetTypes().SelectMany(type => type.GetMethods(Static)))
                if (one.GetCustomAttributes(typeof(RuntimeInitializeOnLoadMethodAttribute), false).Any()) one.Invoke(null, null);
            var holder = new GameObject("Main Camera");
            camera = holder.AddComponent<Camera>();
            headset = Add<HandcalHeadset>(holder);
            Add<FollowHead>(holder);
            Add<PairByTyping>(holder).headset = headset;
            foreach (string field in arguments.Skip(1).Where(one => !one.StartsWith("native="))) Set(field);
            Head(new float[] { 0, 0, 0, 0, 0, 0, 1 });
            string native = arguments.FirstOrDefault(one => one.StartsWith("native="));
            if (native != null) Hook(native == "native=moves");
            foreach (MonoBehaviour one in Behaviours) Call(one, "OnEnable");
            string line;
            while ((line = Console.ReadLine()) != null) Obey(line.Split(new[] { ' ' }, 2));
            foreach (MonoBehaviour one in Behaviours) Call(one, "OnDisable");
        }

        /// <summary>Hooks the views into the runtime of resources/openxr/test, as Unity's plug-in does.</summary>
        static void Hook(bool movesViews)
        {
            var views = new HandcalViews { movesViews = movesViews };
            const BindingFlags Own = BindingFlags.Instance | BindingFlags.NonPublic;
            IntPtr runtime = dlopen("libunity_runtime.so", 2);
            object[] get = { runtime == IntPtr.Zero ? IntPtr.Zero : dlsym(runtime, "test_get") };
            hook = (IntPtr)typeof(HandcalViews).GetMethod("HookGetInstanceProcAddr", Own).Invoke(views, get);
            typeof(HandcalViews).GetMethod("OnSessionCreate", Own).Invoke(views, new object[] { 1ul });
        }

        [DllImport("libc.so.6")]
        static extern IntPtr getenv(string name);

        [DllImport("libdl.so.2")]
        static extern IntPtr dlopen(string name, int flags);

        [DllImport("libdl.so.2")]
        static extern IntPtr dlsym(IntPtr library, string name);

        [DllImport("unity_runtime")]
        static extern void test_views(float[] numbers);

        [DllImport("unity_runtime")]
        static extern void test_frame(IntPtr get, float[] to);

        static T Add<T>(GameObject holder) where T : MonoBehaviour
        {
            var one = holder.AddComponent<T>();
            Behaviours.Add(one);
            return one;
        }

        static void Obey(string[] words)
        {
            string rest = words.Length > 1 ? words[1] : "";
            switch (words[0])
            {
                case "frames": for (int i = 0; i < int.Parse(rest); i++) Frame(); break;
                case "head": Head(Numbers(rest)); break;
                case "eyes": Eyes(Numbers(rest)[0]); break;
                case "parent": Parent(Numbers(rest)); break;
                case "edges": Edges(Numbers(rest)); break;
                case "ahead": Microsoft.MixedReality.OpenXR.OpenXRTime.StubAheadNs = (long)(1e6 * Numbers(rest)[0]); break;
                case "own": test_views(Numbers(rest)); break;
                case "press": Input.StubPressed.Add((KeyCode)Enum.Parse(typeof(KeyCode), rest)); break;
                case "hold": InputDevice.StubFeatures[rest] = true; break;
                case "release": InputDevice.StubFeatures[rest] = false; break;
                case "type":
                    TouchScreenKeyboard.StubOpen.text = rest;
                    TouchScreenKeyboard.StubOpen.status = TouchScreenKeyboard.Status.Done;
                    break;
                case "set": Set(rest); break;
                case "kept": headset.ShowKept(rest); break;
                case "mono": camera.stereoEnabled = false; break;
                case "single": XRDisplaySubsystem.StubOnly.StubIsSinglePass = true; break;
                case "pipeline": UnityEngine.Rendering.GraphicsSettings.currentRenderPipeline = new UnityEngine.Rendering.StubPipeline(); break;
                case "disable": Call(headset, "OnDisable"); headset.enabled = false; break;
                case "enable": headset.enabled = true; Call(headset, "OnEnable"); break;
                case "state": Tell(); break;
                default: throw new ArgumentException(words[0]);
            }
        }

        static void Frame()
        {
            foreach (MonoBehaviour one in Behaviours.Where(one => one.enabled).ToList())
            {
                if (!Started.Contains(one)) Call(one, "Start");
                Started.Add(one);
            }
            foreach (MonoBehaviour one in Behaviours.Where(one => one.enabled).ToList()) Call(one, "Update");
            Input.StubPressed.Clear();
            if (hook != IntPtr.Zero) test_frame(hook, NativeViews);
            Application.StubBeforeRender();
            Microsoft.MixedReality.OpenXR.ViewConfiguration.StubSettings = new Microsoft.MixedReality.OpenXR.ReprojectionSettings();
            // A scriptable pipeline renders without these calls.
            bool isBuiltIn = UnityEngine.Rendering.GraphicsSettings.currentRenderPipeline == null;
            for (int eye = 0; eye < (camera.stereoEnabled ? 2 : 1) && isBuiltIn; eye++) Render(eye);
            if (!isBuiltIn) UnityEngine.Rendering.RenderPipelineManager.StubEnd(camera);
            Time.realtimeSinceStartup += 1f / 60;  // whatever a frame takes here
            Thread.Sleep(4);
        }

        static void Render(int eye)
        {
            camera.stereoActiveEye = camera.stereoEnabled
                ? (Camera.MonoOrStereoscopicEye)eye : Camera.MonoOrStereoscopicEye.Mono;
            foreach (string message in new[] { "OnPreCull", "OnPreRender" })
                foreach (MonoBehaviour one in Behaviours.Where(one => one.enabled)) Call(one, message);
            var side = (Camera.StereoscopicEye)eye;
            Projections[eye] = camera.stereoEnabled ? camera.GetStereoProjectionMatrix(side) : camera.projectionMatrix;
            Views[eye] = camera.stereoEnabled ? camera.GetStereoViewMatrix(side) : camera.worldToCameraMatrix;
            Camera.onPostRender?.Invoke(camera);
            Hidden[eye] = string.Join(",", Drawn().Where(IsHidden).Select(one => one.name.Substring(8)));
        }

        static bool IsHidden(GameObject one)
        {
            var floats = one.StubComponents.OfType<MeshRenderer>().Single().sharedMaterial.StubFloats;
            return floats["_Eyes"] != 3 && floats["_Eyes"] != floats["_Eye"];
        }

        static IEnumerable<GameObject> Drawn()
        {
            return GameObject.StubAll.Where(
                one => !one.StubIsDestroyed && one.StubComponents.OfType<MeshFilter>().Any());
        }

        static void Tell()
        {
            Say("connected", headset.IsConnected);
            Say("paired", headset.IsPaired);
            Say("wearer", headset.Wearer);
            Say("kept", string.Join(",", headset.KeptWearers()));
            Say("warning", headset.Warning);
            Say("log", string.Join("|", Debug.StubLog));
            var texts = GameObject.StubAll.Where(one => !one.StubIsDestroyed).SelectMany(one => one.StubComponents.OfType<TextMesh>());
            Say("text", string.Join("#", texts.Select(one => one.text.Replace("\n", "/"))));
            bool isAsking = TouchScreenKeyboard.StubOpen?.status == TouchScreenKeyboard.Status.Visible;
            Say("keyboard", isAsking ? "open:" + TouchScreenKeyboard.StubOpen.text : "");
            foreach (GameObject one in Drawn()) Say(one.name.Substring(8), Points(one));
            for (int eye = 0; eye < 2; eye++)
            {
                Say("projection" + eye, Matrix(Projections[eye]));
                Say("view" + eye, Matrix(Views[eye]));
                Say("hidden" + eye, Hidden[eye]);
            }
            Say("layer", Marshal.PtrToStringAnsi(getenv("HANDCAL_OPENXR_OFF")));
            Say("native", Write(NativeViews));
            Say("culling", Matrix(camera.cullingMatrix));
            Vector3 focus = XRDisplaySubsystem.StubOnly.StubFocus;
            Say("focus", Write(focus.x, focus.y, focus.z));
            var plane = Microsoft.MixedReality.OpenXR.ViewConfiguration.StubSettings;
            Vector3 at = plane.ReprojectionPlaneOverridePosition ?? Vector3.zero, normal = plane.ReprojectionPlaneOverrideNormal ?? Vector3.zero;
            Say("reprojection", plane.ReprojectionMode + " " + Write(at.x, at.y, at.z, normal.x, normal.y, normal.z));
            Console.WriteLine();
        }

        /// <summary>The strokes' beginnings, in the world; those of the target in the view.</summary>
        static string Points(GameObject one)
        {
            Mesh mesh = one.StubComponents.OfType<MeshFilter>().Single().sharedMesh;
            var told = new StringBuilder();
            for (int i = 0; i < mesh.StubStrokes; i++)
            {
                Vector3 at = mesh.vertices[4 * i];
                if (one.name != "handcal target") at = one.transform.TransformPoint(at);
                told.Append(i == 0 ? "" : " ").Append(Write(at.x, at.y, at.z));
            }
            return told.ToString();
        }

        static string Matrix(Matrix4x4 matrix)
        {
            return Write(Enumerable.Range(0, 16).Select(i => matrix[i / 4, i % 4]).ToArray());
        }

        static string Write(params float[] numbers)
        {
            return string.Join(" ", numbers.Select(one => one.ToString("R", CultureInfo.InvariantCulture)));
        }

        static void Say(string name, object value)
        {
            Console.WriteLine(name + "=" + value);
        }

        static void Head(float[] n)
        {
            InputDevice.StubFeatures["CenterEyePosition"] = new Vector3(n[0], n[1], n[2]);
            InputDevice.StubFeatures["CenterEyeRotation"] = new Quaternion(n[3], n[4], n[5], n[6]);
        }

        /// <summary>The eyes that the runtime tells, as far apart, at the head's pose.</summary>
        static void Eyes(float distanceM)
        {
            foreach (string side in new[] { "Left", "Right" })
            {
                float x = side == "Left" ? -0.5f * distanceM : 0.5f * distanceM;
                InputDevice.StubFeatures[side + "EyePosition"] = new Vector3(x, 0, 0);
                InputDevice.StubFeatures[side + "EyeRotation"] = Quaternion.identity;
            }
        }

        /// <summary>The runtime's projection, by the tangents of its right and its upper edge.</summary>
        static void Edges(float[] n)
        {
            var projection = Matrix4x4.TRS(Vector3.zero, Quaternion.identity, new Vector3(1 / n[0], 1 / n[1], -1));
            projection[3, 2] = -1;
            projection[3, 3] = 0;
            Camera.StubRuntimeProjection = projection;
        }

        /// <summary>Gives the camera a parent: position, quaternion and scale.</summary>
        static void Parent(float[] n)
        {
            Transform parent = new GameObject("origin").transform;
            parent.localPosition = new Vector3(n[0], n[1], n[2]);
            parent.localRotation = new Quaternion(n[3], n[4], n[5], n[6]);
            parent.localScale = n[7] * Vector3.one;
            camera.transform.parent = parent;
            foreach (MonoBehaviour one in Behaviours.Where(one => one.enabled)) Call(one, "OnTransformParentChanged");
        }

        static void Set(string assignment)
        {
            string[] parts = assignment.Split(new[] { '=' }, 2);
            FieldInfo field = typeof(HandcalHeadset).GetField(parts[0]);
            field.SetValue(headset, Convert.ChangeType(parts[1], field.FieldType, CultureInfo.InvariantCulture));
        }

        static void Call(MonoBehaviour one, string message)
        {
            MethodInfo method = one.GetType().GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic);
            try
            {
                method?.Invoke(one, null);
            }
            catch (TargetInvocationException error)
            {
                // Unity logs it and goes on.
                Debug.StubLog.Add(message + ": " + error.InnerException);
            }
        }

        static float[] Numbers(string line)
        {
            return Array.ConvertAll(line.Split(' '), one => float.Parse(one, CultureInfo.InvariantCulture));
        }
    }
}
