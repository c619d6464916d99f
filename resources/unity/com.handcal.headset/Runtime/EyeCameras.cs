using System.Collections.Generic;
using Handcal.Link;
using UnityEngine;
using UnityEngine.XR;

namespace Handcal
{
    /// <summary>
    /// Renders each eye with its calibrated projection and the rig's view. The views that the
    /// runtime submits to its compositor stay its own: submitting these would ask it to undo them.
    /// </summary>
    sealed class EyeCameras
    {
        const float BehindM = 0.5f;
        static readonly List<XRDisplaySubsystem> Displays = new List<XRDisplaySubsystem>();
        readonly Camera camera;
        bool isSet;

        public EyeCameras(Camera camera)
        {
            this.camera = camera;
        }

        /// <summary>The eye that is rendered now; without a headset the camera is the left eye.</summary>
        public Eyes ActiveEye
        {
            get { return camera.stereoActiveEye == Camera.MonoOrStereoscopicEye.Right ? Eyes.Right : Eyes.Left; }
        }

        /// <summary>The display that runs; null if there is none.</summary>
        public static XRDisplaySubsystem Display()
        {
#if UNITY_2020_2_OR_NEWER
            SubsystemManager.GetSubsystems(Displays);
#else
            SubsystemManager.GetInstances(Displays);
#endif
            return Displays.Find(one => one.running);
        }

        public void Apply(HeadsetState state)
        {
            Matrix4x4 headFromWorld = WorldFromHead().inverse;
            if (!camera.stereoEnabled)
            {
                if (state.Left == null) return;
                camera.projectionMatrix = Projection(state.Left, state.IsOffline);
                camera.worldToCameraMatrix = View(state.Left, state.IsOffline) * headFromWorld;
            }
            else
            {
                Set(Camera.StereoscopicEye.Left, state.Left, state.IsOffline, headFromWorld);
                Set(Camera.StereoscopicEye.Right, state.Right, state.IsOffline, headFromWorld);
                if (state.Left != null && state.Right != null) camera.cullingMatrix = Culling() * headFromWorld;
            }
            isSet = true;
        }

        /// <summary>Gives the camera back to the runtime.</summary>
        public void Reset()
        {
            if (!isSet) return;
            isSet = false;
            camera.ResetStereoProjectionMatrices();
            camera.ResetStereoViewMatrices();
            camera.ResetProjectionMatrix();
            camera.ResetWorldToCameraMatrix();
            camera.ResetCullingMatrix();
        }

        /// <summary>
        /// The plane for the compositor to stabilise the picture at, in the world: that of the virtual
        /// image, where the calibrated and the submitted view have the same pixels.
        /// </summary>
        public void FocusPlane(float distanceM, out Vector3 point, out Vector3 normal)
        {
            Matrix4x4 worldFromHead = WorldFromHead();
            point = worldFromHead.MultiplyPoint3x4(new Vector3(0, 0, distanceM));
            normal = Vector3.Normalize(worldFromHead.MultiplyPoint3x4(Vector3.zero) - point);
        }

        /// <summary>
        /// From the head's metres to the world: the pose that is sent, in the space of the camera's
        /// parent, which may be moved, turned and scaled.
        /// </summary>
        Matrix4x4 WorldFromHead()
        {
            Transform head = camera.transform;
            Matrix4x4 parentFromHead = Matrix4x4.TRS(head.localPosition, head.localRotation, Vector3.one);
            return head.parent == null ? parentFromHead : head.parent.localToWorldMatrix * parentFromHead;
        }

        void Set(Camera.StereoscopicEye eye, Projection one, bool isOffline, Matrix4x4 headFromWorld)
        {
            if (one == null) return;
            camera.SetStereoProjectionMatrix(eye, Projection(one, isOffline));
            camera.SetStereoViewMatrix(eye, View(one, isOffline) * headFromWorld);
        }

        Matrix4x4 Projection(Projection one, bool isOffline)
        {
            return ToMatrix(Matrices.UnityProjection(
                one.Drawn(isOffline), one.WidthPx, one.HeightPx, camera.nearClipPlane, camera.farClipPlane));
        }

        static Matrix4x4 View(Projection one, bool isOffline)
        {
            return ToMatrix(Matrices.UnityViewFromHead(one.TVH, one.Drawn(isOffline)));
        }

        /// <summary>
        /// From the head's metres to the clip space of one frustum around both eyes', from a point
        /// behind them. Unity would cull by the runtime's views, from which these differ.
        /// </summary>
        Matrix4x4 Culling()
        {
            float x = 0, y = 0, nearM = float.MaxValue, farM = 0;
            foreach (Camera.StereoscopicEye eye in new[] { Camera.StereoscopicEye.Left, Camera.StereoscopicEye.Right })
            {
                Matrix4x4 clipFromHead = camera.GetStereoProjectionMatrix(eye)
                    * camera.GetStereoViewMatrix(eye) * WorldFromHead();
                for (int corner = 0; corner < 8; corner++)
                {
                    Vector3 at = clipFromHead.inverse.MultiplyPoint(
                        new Vector3((corner & 1) * 2 - 1, (corner & 2) - 1, (corner & 4) / 2 - 1));
                    float depthM = at.z + BehindM;
                    x = Mathf.Max(x, Mathf.Abs(at.x) / depthM);
                    y = Mathf.Max(y, Mathf.Abs(at.y) / depthM);
                    nearM = Mathf.Min(nearM, depthM);
                    farM = Mathf.Max(farM, depthM);
                }
            }
            const float Margin = 0.99f;  // for float32's rounding
            float zScale = (farM + nearM) / (farM - nearM), zOffset = -2 * farM * nearM / (farM - nearM);
            var frustum = new Matrix4x4();
            frustum[0, 0] = Margin / x;
            frustum[1, 1] = Margin / y;
            frustum[2, 2] = Margin * zScale;
            frustum[2, 3] = Margin * (zScale * BehindM + zOffset);
            frustum[3, 2] = 1;
            frustum[3, 3] = BehindM;
            return frustum;
        }

        internal static Matrix4x4 ToMatrix(double[] rows)
        {
            var matrix = new Matrix4x4();
            for (int row = 0; row < 4; row++)
                for (int column = 0; column < 4; column++)
                    matrix[row, column] = (float)rows[4 * row + column];
            return matrix;
        }
    }
}
