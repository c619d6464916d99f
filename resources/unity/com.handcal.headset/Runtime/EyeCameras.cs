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
        readonly Camera camera;
        readonly List<XRDisplaySubsystem> displays = new List<XRDisplaySubsystem>();
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

        public void Apply(HeadsetState state)
        {
            Matrix4x4 headFromWorld = WorldFromHead().inverse;
            if (!camera.stereoEnabled)
            {
                if (state.Left == null) return;
                camera.projectionMatrix = Projection(state.Left, state.IsOffline);
                camera.worldToCameraMatrix = View(state.Left) * headFromWorld;
            }
            else
            {
                Set(Camera.StereoscopicEye.Left, state.Left, state.IsOffline, headFromWorld);
                Set(Camera.StereoscopicEye.Right, state.Right, state.IsOffline, headFromWorld);
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
        }

        /// <summary>
        /// Puts the plane at which the compositor stabilises the picture to the virtual image, where
        /// the calibrated and the submitted view have the same pixels.
        /// </summary>
        public void SetFocusPlane(float distanceM)
        {
            Matrix4x4 worldFromHead = WorldFromHead();
            Vector3 head = worldFromHead.MultiplyPoint3x4(Vector3.zero);
            Vector3 point = worldFromHead.MultiplyPoint3x4(new Vector3(0, 0, distanceM));
#if UNITY_2020_2_OR_NEWER
            SubsystemManager.GetSubsystems(displays);
#else
            SubsystemManager.GetInstances(displays);
#endif
            foreach (XRDisplaySubsystem display in displays)
                if (display.running)
                    display.SetFocusPlane(point, Vector3.Normalize(head - point), Vector3.zero);
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
            camera.SetStereoViewMatrix(eye, View(one) * headFromWorld);
        }

        Matrix4x4 Projection(Projection one, bool isOffline)
        {
            return ToMatrix(Matrices.UnityProjection(
                one.Drawn(isOffline), one.WidthPx, one.HeightPx, camera.nearClipPlane, camera.farClipPlane));
        }

        static Matrix4x4 View(Projection one)
        {
            return ToMatrix(Matrices.UnityViewFromHead(one.TVH));
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
