// The part of Unity's OpenXR plug-in that the package uses; see UnityEngine.cs.
using System;

namespace UnityEngine
{
    public class ScriptableObject : Object { }
}

namespace UnityEngine.XR.OpenXR.Features
{
    public abstract class OpenXRFeature : ScriptableObject
    {
        /// <summary>Protected and internal in another assembly, which looks the same from here.</summary>
        protected virtual IntPtr HookGetInstanceProcAddr(IntPtr func) { return func; }
        protected virtual void OnSessionCreate(ulong xrSession) { }
        protected virtual void OnSessionDestroy(ulong xrSession) { }
    }
}

namespace UnityEditor
{
    public enum BuildTargetGroup { Standalone = 1, Android = 7, WSA = 14 }
}

namespace UnityEditor.XR.OpenXR.Features
{
    public class OpenXRFeatureAttribute : Attribute
    {
        public string UiName, Company, Version, FeatureId, Desc, OpenxrExtensionStrings;
        public BuildTargetGroup[] BuildTargetGroups;
    }
}
