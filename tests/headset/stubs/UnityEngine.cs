// The part of Unity's interface that the package uses: signatures of Unity 2019.4's scripting
// reference. Only what a test asks of it has a body; what Unity does not have begins with "Stub".
#pragma warning disable 67, 414, 649
using System;
using System.Collections.Generic;
using System.Linq;

namespace UnityEngine
{
    public class Object
    {
        public string name { get; set; }
        public bool StubIsDestroyed;
        public static void Destroy(Object one) { one.StubIsDestroyed = true; }
    }

    public class Component : Object
    {
        public Transform transform { get { return gameObject.transform; } }
        public GameObject gameObject { get; internal set; }
        public T GetComponent<T>() { return gameObject.StubComponents.OfType<T>().FirstOrDefault(); }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; } = true;
    }

    public class MonoBehaviour : Behaviour { }

    public sealed class GameObject : Object
    {
        public static readonly List<GameObject> StubAll = new List<GameObject>();
        public readonly List<Component> StubComponents = new List<Component>();

        public GameObject(string name)
        {
            this.name = name;
            transform = AddComponent<Transform>();
            StubAll.Add(this);
        }

        public Transform transform { get; private set; }

        /// <summary>Unlike Unity, leaves OnEnable to the player, so that fields can be set before.</summary>
        public T AddComponent<T>() where T : Component
        {
            var one = Activator.CreateInstance<T>();
            one.gameObject = this;
            StubComponents.Add(one);
            return one;
        }
    }

    public class Transform : Component
    {
        public Transform parent { get; set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; } = Quaternion.identity;
        public Vector3 localScale { get; set; } = Vector3.one;
        public Vector3 position { get { return localToWorldMatrix.MultiplyPoint3x4(Vector3.zero); } }
        public Quaternion rotation { get { return parent == null ? localRotation : parent.rotation * localRotation; } }
        public Vector3 forward { get { return rotation * new Vector3(0, 0, 1); } }
        public Matrix4x4 worldToLocalMatrix { get { return localToWorldMatrix.inverse; } }

        public Matrix4x4 localToWorldMatrix
        {
            get
            {
                Matrix4x4 own = Matrix4x4.TRS(localPosition, localRotation, localScale);
                return parent == null ? own : parent.localToWorldMatrix * own;
            }
        }

        public void SetParent(Transform parent, bool worldPositionStays) { this.parent = parent; }
        public Vector3 TransformPoint(Vector3 point) { return localToWorldMatrix.MultiplyPoint3x4(point); }
    }

    [AttributeUsage(AttributeTargets.Class, AllowMultiple = true)]
    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type type) { }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DisallowMultipleComponent : Attribute { }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class AddComponentMenu : Attribute
    {
        public AddComponentMenu(string name) { }
    }

    [AttributeUsage(AttributeTargets.Field)]
    public class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string text) { }
    }

    [AttributeUsage(AttributeTargets.Method)]
    public class BeforeRenderOrderAttribute : Attribute
    {
        public readonly int order;
        public BeforeRenderOrderAttribute(int order) { this.order = order; }
    }

    public enum RuntimeInitializeLoadType { AfterSceneLoad, BeforeSceneLoad, SubsystemRegistration }

    [AttributeUsage(AttributeTargets.Method)]
    public class RuntimeInitializeOnLoadMethodAttribute : Attribute
    {
        public RuntimeInitializeOnLoadMethodAttribute(RuntimeInitializeLoadType loadType) { }
    }

    public delegate void UnityAction();

    public class Application
    {
        public static event UnityAction onBeforeRender;
        public static string persistentDataPath { get; set; }
        public static string productName { get { return "stub"; } }
        public static string version { get { return "1"; } }

        public static void StubBeforeRender()
        {
            foreach (Delegate one in onBeforeRender.GetInvocationList().OrderBy(Order)) one.DynamicInvoke();
        }

        static int Order(Delegate one)
        {
            return one.Method.GetCustomAttributes(false).OfType<BeforeRenderOrderAttribute>().Single().order;
        }
    }

    public sealed class SystemInfo
    {
        public static string deviceName { get { return "<unknown>"; } }
        public static string deviceModel { get { return "Stub 3"; } }
        public static string operatingSystem { get { return "stub"; } }
    }

    public class Time
    {
        public static float realtimeSinceStartup { get; set; }
    }

    public class Debug
    {
        public static readonly List<string> StubLog = new List<string>();
        public static void LogWarning(object message, Object context) { StubLog.Add(message.ToString()); }
        public static void LogWarning(object message) { LogWarning(message, null); }
    }

    public class UnityException : Exception
    {
        public UnityException(string message) : base(message) { }
    }

    public class Cursor { }  // so that a name that means two things is found

    public sealed class Camera : Behaviour
    {
        public enum StereoscopicEye { Left, Right }
        public enum MonoOrStereoscopicEye { Left, Right, Mono }

        public delegate void CameraCallback(Camera cam);
        public static CameraCallback onPostRender;

        /// <summary>At first the identity, as Unity's documentation says of the first frames.</summary>
        public static Matrix4x4 StubRuntimeProjection = Matrix4x4.identity;
        readonly Matrix4x4[] projections = { StubRuntimeProjection, StubRuntimeProjection };
        readonly Matrix4x4[] views = { Matrix4x4.identity, Matrix4x4.identity };
        public bool stereoEnabled { get; set; } = true;
        public MonoOrStereoscopicEye stereoActiveEye { get; set; }
        public float nearClipPlane { get; set; } = 0.1f;
        public float farClipPlane { get; set; } = 50;
        public Matrix4x4 projectionMatrix { get; set; }
        public Matrix4x4 worldToCameraMatrix { get; set; }
        public Matrix4x4 GetStereoProjectionMatrix(StereoscopicEye eye) { return projections[(int)eye]; }
        public Matrix4x4 GetStereoViewMatrix(StereoscopicEye eye) { return views[(int)eye]; }
        public void SetStereoProjectionMatrix(StereoscopicEye eye, Matrix4x4 matrix) { projections[(int)eye] = matrix; }
        public void SetStereoViewMatrix(StereoscopicEye eye, Matrix4x4 matrix) { views[(int)eye] = matrix; }
        public void ResetStereoProjectionMatrices() { projections[0] = projections[1] = StubRuntimeProjection; }
        public void ResetStereoViewMatrices() { views[0] = views[1] = Matrix4x4.identity; }
        public void ResetProjectionMatrix() { projectionMatrix = new Matrix4x4(); }
        public void ResetWorldToCameraMatrix() { worldToCameraMatrix = new Matrix4x4(); }
        public Matrix4x4 cullingMatrix { get; set; }
        public void ResetCullingMatrix() { cullingMatrix = new Matrix4x4(); }
    }

    public struct RenderTextureDescriptor
    {
        public int width { get; set; }
        public int height { get; set; }
    }

    public enum MeshTopology { Triangles, Quads = 2, Lines, LineStrip, Points }

    public sealed class Mesh : Object
    {
        public Rendering.IndexFormat indexFormat { get; set; }
        public Vector3[] vertices { get; set; }
        public Vector3[] normals { get; set; }
        public Vector2[] uv { get; set; }
        public Bounds bounds { get; set; }
        public void MarkDynamic() { }
        public int StubStrokes;
        public void Clear() { StubStrokes = 0; }

        public void SetIndices(
            int[] indices, int start, int length, MeshTopology topology, int submesh, bool calculateBounds = true,
            int baseVertex = 0)
        {
            if (length % 6 != 0 || indices.Skip(start).Take(length).Any(one => one >= vertices.Length))
                throw new ArgumentException("no indices of these vertices");
            StubStrokes = length / 6;
        }
    }

    public sealed class MeshFilter : Component
    {
        public Mesh sharedMesh { get; set; }
    }

    public class Renderer : Component
    {
        public Material sharedMaterial { get; set; }
        public Rendering.ShadowCastingMode shadowCastingMode { get; set; }
    }

    public class MeshRenderer : Renderer { }

    public sealed class Shader : Object { }

    public class Material : Object
    {
        public Material(Shader shader) { }
        public readonly Dictionary<string, float> StubFloats = new Dictionary<string, float>();
        public Color StubColor;
        public void SetFloat(string name, float value) { StubFloats[name] = value; }
        public void SetColor(string name, Color value) { StubColor = value; }
    }

    public sealed class Resources
    {
        public static T Load<T>(string path) where T : Object { return null; }
    }

    public enum TextAnchor { UpperLeft, UpperCenter, UpperRight, MiddleLeft, MiddleCenter, MiddleRight, LowerLeft, LowerCenter }
    public enum TextAlignment { Left, Center, Right }

    public sealed class TextMesh : Component
    {
        public string text { get; set; } = "";
        public TextAnchor anchor { get; set; }
        public TextAlignment alignment { get; set; }
        public int fontSize { get; set; }
        public float characterSize { get; set; }
    }

    public enum KeyCode
    {
        None, Return, Space, RightArrow, LeftArrow, DownArrow, UpArrow, Plus, KeypadPlus, Equals, Minus,
        KeypadMinus, JoystickButton14, JoystickButton15,
    }

    public class Input
    {
        public static readonly HashSet<KeyCode> StubPressed = new HashSet<KeyCode>();
        public static bool GetKeyDown(KeyCode key) { return StubPressed.Contains(key); }
    }

    public class TouchScreenKeyboard
    {
        public enum Status { Visible, Done, Canceled, LostFocus }
        public static TouchScreenKeyboard StubOpen;
        public Status status { get; set; }
        public string text { get; set; }
        public static bool isSupported { get { return true; } }

        public static TouchScreenKeyboard Open(string text)
        {
            return StubOpen = new TouchScreenKeyboard { text = text };
        }
    }

    public static class SubsystemManager
    {
        public static void GetInstances<T>(List<T> subsystems) { GetSubsystems(subsystems); }

        public static void GetSubsystems<T>(List<T> subsystems)
        {
            subsystems.Clear();
            subsystems.AddRange(new[] { XR.XRDisplaySubsystem.StubOnly }.OfType<T>());
        }
    }
}
