using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR;

/// <summary>Moves the camera with the head, for projects without a tracked pose driver.</summary>
public sealed class FollowHead : MonoBehaviour
{
    readonly List<InputDevice> devices = new List<InputDevice>();

    void OnEnable()
    {
        Application.onBeforeRender += Follow;
    }

    void OnDisable()
    {
        Application.onBeforeRender -= Follow;
    }

    void Update()
    {
        Follow();
    }

    [BeforeRenderOrder(-30000)]
    void Follow()
    {
        InputDevices.GetDevicesAtXRNode(XRNode.CenterEye, devices);
        foreach (InputDevice device in devices)
        {
            if (device.TryGetFeatureValue(CommonUsages.centerEyePosition, out Vector3 position))
                transform.localPosition = position;
            if (device.TryGetFeatureValue(CommonUsages.centerEyeRotation, out Quaternion rotation))
                transform.localRotation = rotation;
        }
    }
}
