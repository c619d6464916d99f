// See UnityEngine.cs.
#pragma warning disable 67, 414, 649
using System;
using System.Collections.Generic;

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
    public enum ShadowCastingMode { Off, On }
    public abstract class RenderPipelineAsset : Object { }
    public sealed class StubPipeline : RenderPipelineAsset { }

    public struct ScriptableRenderContext { }

    public static class RenderPipelineManager
    {
        public static event Action<ScriptableRenderContext, Camera> endCameraRendering;
        public static void StubEnd(Camera camera) { endCameraRendering?.Invoke(new ScriptableRenderContext(), camera); }
    }

    public sealed class GraphicsSettings : Object
    {
        public static RenderPipelineAsset currentRenderPipeline { get; set; }
    }
}

namespace UnityEngine.XR
{
    public enum XRNode { LeftEye, RightEye, CenterEye, Head }

    public struct InputFeatureUsage<T> : IEquatable<InputFeatureUsage<T>>
    {
        public string name { get; set; }
        public InputFeatureUsage(string name) { this.name = name; }
        public bool Equals(InputFeatureUsage<T> other) { return name == other.name; }
    }

    public static class CommonUsages
    {
        public static InputFeatureUsage<bool> triggerButton = new InputFeatureUsage<bool>("TriggerButton");
        public static InputFeatureUsage<bool> primaryButton = new InputFeatureUsage<bool>("PrimaryButton");
        public static InputFeatureUsage<bool> secondaryButton = new InputFeatureUsage<bool>("SecondaryButton");
        public static InputFeatureUsage<Vector2> primary2DAxis = new InputFeatureUsage<Vector2>("Primary2DAxis");
        public static InputFeatureUsage<Vector3> leftEyePosition = new InputFeatureUsage<Vector3>("LeftEyePosition");
        public static InputFeatureUsage<Vector3> rightEyePosition = new InputFeatureUsage<Vector3>("RightEyePosition");
        public static InputFeatureUsage<Vector3> centerEyePosition = new InputFeatureUsage<Vector3>("CenterEyePosition");
        public static InputFeatureUsage<Quaternion> leftEyeRotation = new InputFeatureUsage<Quaternion>("LeftEyeRotation");
        public static InputFeatureUsage<Quaternion> rightEyeRotation = new InputFeatureUsage<Quaternion>("RightEyeRotation");
        public static InputFeatureUsage<Quaternion> centerEyeRotation = new InputFeatureUsage<Quaternion>("CenterEyeRotation");
    }

    [Flags]
    public enum InputDeviceCharacteristics : uint { None = 0, HeadMounted = 1, HeldInHand = 4, HandTracking = 8, Controller = 64 }

    public struct InputDevice
    {
        /// <summary>The head, the eyes, a controller's and the hands' buttons, by the names of the features.</summary>
        public static readonly Dictionary<string, object> StubFeatures = new Dictionary<string, object>();
        public InputDeviceCharacteristics characteristics { get; set; }
        public bool TryGetFeatureValue(InputFeatureUsage<bool> usage, out bool value) { return Get(usage.name, out value); }
        public bool TryGetFeatureValue(InputFeatureUsage<Vector2> usage, out Vector2 value) { return Get(usage.name, out value); }
        public bool TryGetFeatureValue(InputFeatureUsage<Vector3> usage, out Vector3 value) { return Get(usage.name, out value); }
        public bool TryGetFeatureValue(InputFeatureUsage<Quaternion> usage, out Quaternion value) { return Get(usage.name, out value); }

        /// <summary>Features of a hand begin with its place among the devices.</summary>
        public string StubPrefix;

        bool Get<T>(string name, out T value)
        {
            bool isKnown = StubFeatures.TryGetValue(StubPrefix + name, out object found);
            value = isKnown ? (T)found : default(T);
            return isKnown;
        }
    }

    public class InputDevices
    {
        public static void GetDevices(List<InputDevice> devices)
        {
            GetDevicesAtXRNode(XRNode.Head, devices);
            foreach (string hand in new[] { "left ", "right " })
                devices.Add(new InputDevice { characteristics = InputDeviceCharacteristics.HandTracking, StubPrefix = hand });
        }

        public static void GetDevicesAtXRNode(XRNode node, List<InputDevice> devices)
        {
            devices.Clear();
            devices.Add(new InputDevice());
        }
    }

    public class XRDisplaySubsystemDescriptor
    {
        public string id { get { return "stub"; } }
    }

    public class XRDisplaySubsystem
    {
        public struct XRRenderParameter
        {
            public Matrix4x4 view, projection;
        }

        public struct XRRenderPass
        {
            public RenderTextureDescriptor renderTargetDesc;
            public int StubEyes;
            public int GetRenderParameterCount() { return StubEyes; }

            public void GetRenderParameter(Camera camera, int renderParameterIndex, out XRRenderParameter renderParameter)
            {
                renderParameter = new XRRenderParameter { projection = Camera.StubRuntimeProjection };
            }
        }

        public static readonly XRDisplaySubsystem StubOnly = new XRDisplaySubsystem();
        public Vector3 StubFocus;
        public bool StubIsSinglePass;
        public XRDisplaySubsystemDescriptor subsystemDescriptor { get { return new XRDisplaySubsystemDescriptor(); } }
        public XRDisplaySubsystemDescriptor SubsystemDescriptor { get { return subsystemDescriptor; } }
        public bool running { get { return true; } }
        public void SetFocusPlane(Vector3 point, Vector3 normal, Vector3 velocity) { StubFocus = point; }
        public int GetRenderPassCount() { return StubIsSinglePass ? 1 : 2; }

        public void GetRenderPass(int renderPassIndex, out XRRenderPass renderPass)
        {
            renderPass.StubEyes = StubIsSinglePass ? 2 : 1;
            renderPass.renderTargetDesc = new RenderTextureDescriptor { width = 1440, height = 936 };
        }
    }
}

namespace UnityEngine.Windows.Speech
{
    public static class PhraseRecognitionSystem
    {
        public static bool isSupported { get { return true; } }
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
        public KeywordRecognizer(string[] keywords)
        {
            throw new UnityException("Speech recognition is not supported on this machine.");
        }
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
