// The part of Unity's interface that the package uses, to type-check it: signatures of Unity
// 2019.4's scripting reference. Only what a test asks of it has a body.
#pragma warning disable 67, 414, 649
using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public class Object
    {
        public string name { get; set; }
        public static void Destroy(Object one) { }
    }

    public class Component : Object
    {
        public Transform transform { get { return null; } }
        public GameObject gameObject { get { return null; } }
        public T GetComponent<T>() { return default(T); }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour { }

    public sealed class GameObject : Object
    {
        public GameObject(string name) { }
        public Transform transform { get { return null; } }
        public T AddComponent<T>() where T : Component { return default(T); }
    }

    public class Transform : Component
    {
        public Transform parent { get; set; }
        public Vector3 position { get; set; }
        public Quaternion rotation { get; set; }
        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; }
        public Vector3 forward { get; set; }
        public void SetParent(Transform parent, bool worldPositionStays) { }
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
        public BeforeRenderOrderAttribute(int order) { }
    }

    public delegate void UnityAction();

    public class Application
    {
        public static event UnityAction onBeforeRender;
        public static string persistentDataPath { get { return null; } }
        public static string productName { get { return null; } }
        public static string version { get { return null; } }
    }

    public sealed class SystemInfo
    {
        public static string deviceName { get { return null; } }
        public static string operatingSystem { get { return null; } }
    }

    public class Time
    {
        public static float realtimeSinceStartup { get { return 0; } }
    }

    public class Debug
    {
        public static void LogWarning(object message, Object context) { }
    }

    public class Cursor { }  // so that a name that means two things is found

    public struct Vector2
    {
        public float x, y;
        public Vector2(float x, float y) { this.x = x; this.y = y; }
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(); } }
        public static Vector3 one { get { return new Vector3(1, 1, 1); } }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a) { return new Vector3(-a.x, -a.y, -a.z); }
        public static Vector3 operator *(float d, Vector3 a) { return new Vector3(d * a.x, d * a.y, d * a.z); }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
    }

    public struct Color
    {
        public float r, g, b, a;
        public Color(float r, float g, float b) { this.r = r; this.g = g; this.b = b; a = 1; }
        public static Color white { get { return new Color(1, 1, 1); } }
    }

    public struct Bounds
    {
        public Bounds(Vector3 center, Vector3 size) { }
    }

    public struct Matrix4x4
    {
        float m00, m10, m20, m30, m01, m11, m21, m31, m02, m12, m22, m32, m03, m13, m23, m33;

        public float this[int row, int column]
        {
            get
            {
                switch (row + 4 * column)
                {
                    case 0: return m00; case 1: return m10; case 2: return m20; case 3: return m30;
                    case 4: return m01; case 5: return m11; case 6: return m21; case 7: return m31;
                    case 8: return m02; case 9: return m12; case 10: return m22; case 11: return m32;
                    case 12: return m03; case 13: return m13; case 14: return m23; default: return m33;
                }
            }
            set
            {
                switch (row + 4 * column)
                {
                    case 0: m00 = value; break; case 1: m10 = value; break;
                    case 2: m20 = value; break; case 3: m30 = value; break;
                    case 4: m01 = value; break; case 5: m11 = value; break;
                    case 6: m21 = value; break; case 7: m31 = value; break;
                    case 8: m02 = value; break; case 9: m12 = value; break;
                    case 10: m22 = value; break; case 11: m32 = value; break;
                    case 12: m03 = value; break; case 13: m13 = value; break;
                    case 14: m23 = value; break; default: m33 = value; break;
                }
            }
        }

        public Matrix4x4 inverse { get { return this; } }
        public static Matrix4x4 TRS(Vector3 position, Quaternion rotation, Vector3 scale) { return new Matrix4x4(); }
        public static Matrix4x4 operator *(Matrix4x4 a, Matrix4x4 b) { return a; }
    }

    public sealed class Camera : Behaviour
    {
        public enum StereoscopicEye { Left, Right }
        public enum MonoOrStereoscopicEye { Left, Right, Mono }
        public bool stereoEnabled { get { return false; } }
        public MonoOrStereoscopicEye stereoActiveEye { get { return MonoOrStereoscopicEye.Mono; } }
        public float nearClipPlane { get; set; }
        public float farClipPlane { get; set; }
        public Matrix4x4 projectionMatrix { get; set; }
        public Matrix4x4 worldToCameraMatrix { get; set; }
        public Matrix4x4 GetStereoProjectionMatrix(StereoscopicEye eye) { return new Matrix4x4(); }
        public void SetStereoProjectionMatrix(StereoscopicEye eye, Matrix4x4 matrix) { }
        public void SetStereoViewMatrix(StereoscopicEye eye, Matrix4x4 matrix) { }
        public void ResetStereoProjectionMatrices() { }
        public void ResetStereoViewMatrices() { }
        public void ResetProjectionMatrix() { }
        public void ResetWorldToCameraMatrix() { }
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
        public void Clear() { }
        public void SetIndices(int[] indices, MeshTopology topology, int submesh, bool calculateBounds) { }
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
        public void SetFloat(string name, float value) { }
        public void SetColor(string name, Color value) { }
    }

    public sealed class Resources
    {
        public static T Load<T>(string path) where T : Object { return null; }
    }

    public enum TextAnchor { UpperLeft, UpperCenter, UpperRight, MiddleLeft, MiddleCenter }
    public enum TextAlignment { Left, Center, Right }

    public sealed class TextMesh : Component
    {
        public string text { get; set; }
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
        public static bool GetKeyDown(KeyCode key) { return false; }
    }

    public class TouchScreenKeyboard
    {
        public enum Status { Visible, Done, Canceled, LostFocus }
        public Status status { get { return Status.Visible; } }
        public string text { get; set; }
        public static TouchScreenKeyboard Open(string text) { return null; }
    }

    public static class SubsystemManager
    {
        public static void GetInstances<T>(List<T> subsystems) { }
        public static void GetSubsystems<T>(List<T> subsystems) { }
    }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
    public enum ShadowCastingMode { Off, On }
    public abstract class RenderPipelineAsset : Object { }

    public sealed class GraphicsSettings : Object
    {
        public static RenderPipelineAsset currentRenderPipeline { get { return null; } }
    }
}

namespace UnityEngine.XR
{
    public enum XRNode { LeftEye, RightEye, CenterEye, Head }

    public struct InputFeatureUsage<T> : IEquatable<InputFeatureUsage<T>>
    {
        public bool Equals(InputFeatureUsage<T> other) { return false; }
    }

    public static class CommonUsages
    {
        public static InputFeatureUsage<bool> triggerButton, primaryButton, secondaryButton;
        public static InputFeatureUsage<Vector2> primary2DAxis;
        public static InputFeatureUsage<Vector3> leftEyePosition, rightEyePosition, centerEyePosition;
        public static InputFeatureUsage<Quaternion> leftEyeRotation, rightEyeRotation, centerEyeRotation;
    }

    public struct InputDevice
    {
        public bool TryGetFeatureValue(InputFeatureUsage<bool> usage, out bool value) { return value = false; }
        public bool TryGetFeatureValue(InputFeatureUsage<Vector2> usage, out Vector2 value) { value = new Vector2(); return false; }
        public bool TryGetFeatureValue(InputFeatureUsage<Vector3> usage, out Vector3 value) { value = new Vector3(); return false; }
        public bool TryGetFeatureValue(InputFeatureUsage<Quaternion> usage, out Quaternion value) { value = new Quaternion(); return false; }
    }

    public class InputDevices
    {
        public static void GetDevices(List<InputDevice> devices) { }
        public static void GetDevicesAtXRNode(XRNode node, List<InputDevice> devices) { }
    }

    public static class XRSettings
    {
        public enum StereoRenderingMode { MultiPass, SinglePass, SinglePassInstanced, SinglePassMultiview }
        public static StereoRenderingMode stereoRenderingMode { get { return StereoRenderingMode.MultiPass; } }
        public static int eyeTextureWidth { get { return 0; } }
        public static int eyeTextureHeight { get { return 0; } }
        public static string loadedDeviceName { get { return null; } }
    }

    public class XRDisplaySubsystem
    {
        public bool running { get { return false; } }
        public void SetFocusPlane(Vector3 point, Vector3 normal, Vector3 velocity) { }
    }
}

namespace UnityEngine.Windows.Speech
{
    public static class PhraseRecognitionSystem
    {
        public static bool isSupported { get { return false; } }
    }

    public struct PhraseRecognizedEventArgs
    {
        public readonly string text;
        public readonly DateTime phraseStartTime;
    }

    public abstract class PhraseRecognizer : IDisposable
    {
        public delegate void PhraseRecognizedDelegate(PhraseRecognizedEventArgs args);
        public event PhraseRecognizedDelegate OnPhraseRecognized;
        public void Start() { }
        public void Dispose() { }
    }

    public sealed class KeywordRecognizer : PhraseRecognizer
    {
        public KeywordRecognizer(string[] keywords) { }
    }
}

namespace Microsoft.MixedReality.QR
{
    public enum QRCodeWatcherAccessStatus { DeniedBySystem, NotDeclaredByApp, DeniedByUser, UserPromptRequired, Allowed }

    public class QRCode
    {
        public string Data { get { return null; } }
    }

    public class QRCodeAddedEventArgs
    {
        public QRCode Code { get { return null; } }
    }

    public class QRCodeUpdatedEventArgs
    {
        public QRCode Code { get { return null; } }
    }

    public class QRCodeWatcher
    {
        public event EventHandler<QRCodeAddedEventArgs> Added;
        public event EventHandler<QRCodeUpdatedEventArgs> Updated;
        public static System.Threading.Tasks.Task<QRCodeWatcherAccessStatus> RequestAccessAsync() { return null; }
        public void Start() { }
        public void Stop() { }
    }
}
