using System;
using System.Text;
using Handcal.Link;
using UnityEngine;
using Cursor = Handcal.Link.Cursor;

namespace Handcal
{
    /// <summary>
    /// Draws what the PC wants shown. Points and shapes are fixed in the space of the camera's
    /// parent, in which poses are sent; the target is fixed to the eye's camera.
    /// </summary>
    sealed class Drawing : IDisposable
    {
        static readonly int[] Quadrilateral = { 0, 1, 1, 2, 2, 3, 3, 0 };
        static readonly int[] Cube = { 0, 1, 1, 2, 2, 3, 3, 0, 4, 5, 5, 6, 6, 7, 7, 4, 0, 4, 1, 5, 2, 6, 3, 7 };
        static readonly Color Blue = new Color(0.2f, 0.5f, 1), Red = new Color(1, 0.15f, 0.1f);
        const float DotPx = 3, LinePx = 2, TextDistanceM = 2, LineHeight = 0.02f;  // 1.1 degrees
        const int LineCharacters = 32;  // some 18 degrees, less than the narrowest display

        readonly Strokes cursor, live, shape, target;
        readonly TextMesh text;
        string shownLine = "";
        Cursor shownCursor;
        LiveHand shownLive;
        Shape shownShape;
        HeadsetState shownState;
        int shownVersion;

        public Drawing(Transform head)
        {
            cursor = new Strokes("cursor", head.parent, Color.white, DotPx, false);
            live = new Strokes("live hand", head.parent, Blue, DotPx, false);
            shape = new Strokes("shape", head.parent, Color.white, LinePx, false);
            target = new Strokes("target", head, Color.white, LinePx, true);
            var holder = new GameObject("handcal text");
            holder.transform.SetParent(head, false);
            holder.transform.localPosition = new Vector3(0, -7 * LineHeight * TextDistanceM, TextDistanceM);
            text = holder.AddComponent<TextMesh>();
            text.anchor = TextAnchor.LowerCenter;
            text.alignment = TextAlignment.Center;
            text.fontSize = 64;
            text.characterSize = 10 * LineHeight * TextDistanceM / text.fontSize;
        }

        /// <summary>Draws in the space of this parent, in which the camera moves.</summary>
        public Transform Parent { set { cursor.Parent = live.Parent = shape.Parent = value; } }

        public void Show(HeadsetState state, string line)
        {
            if (shownLine != line) text.text = Wrapped(shownLine = line);
            ShowCursor(state.Cursor);
            ShowLive(state.Live);
            if (shownShape != state.Shape) ShowShape(state.Shape);
            if (shownState != state) ShowTarget(state);
        }

        /// <summary>Draws only what belongs to the eye that is rendered next.</summary>
        public void BeginEye(Eyes eye)
        {
            cursor.BeginEye(eye);
            live.BeginEye(eye);
            shape.BeginEye(eye);
            target.BeginEye(eye);
        }

        public void Dispose()
        {
            cursor.Dispose();
            live.Dispose();
            shape.Dispose();
            target.Dispose();
            UnityEngine.Object.Destroy(text.gameObject);
        }

        /// <summary>Breaks lines between words; Unity's TextMesh does not.</summary>
        static string Wrapped(string line)
        {
            var wrapped = new StringBuilder();
            foreach (string paragraph in line.Split('\n'))
            {
                int width = 0;
                foreach (string word in paragraph.Split(' '))
                {
                    bool fits = width == 0 || width + 1 + word.Length <= LineCharacters;
                    if (wrapped.Length > 0) wrapped.Append(width > 0 && fits ? ' ' : '\n');
                    wrapped.Append(word);
                    width = fits && width > 0 ? width + 1 + word.Length : word.Length;
                }
            }
            return wrapped.ToString();
        }

        void ShowCursor(Cursor shown)
        {
            if (shownCursor == shown) return;
            shownCursor = shown;
            Points points = shown == null ? Points.Nothing : shown.Points;
            if (shown != null) cursor.Eyes = shown.Eyes;
            var positionsM = new float[3 * points.Count];
            points.CopyTo(positionsM, 0, 1);
            cursor.Begin(points.Count);
            for (int i = 0; i < points.Count; i++) cursor.Set(i, Unity(positionsM, i), Unity(positionsM, i));
            cursor.End();
        }

        void ShowLive(LiveHand shown)
        {
            int version = shown == null ? 0 : shown.Version;
            if (shownLive == shown && shownVersion == version) return;
            shownLive = shown;
            shownVersion = version;
            int count = shown == null ? 0 : shown.Count;
            live.Begin(count);
            if (count == 0) return;
            live.Color = shown.IsRed ? Red : Blue;
            live.Eyes = shown.Eyes;
            for (int i = 0; i < count; i++)
            {
                int to = shown.IsOutline ? (i + 1) % count : i;
                live.Set(i, Unity(shown.PositionsM, i), Unity(shown.PositionsM, to));
            }
            live.End();
        }

        void ShowShape(Shape shown)
        {
            shownShape = shown;
            if (shown != null) shape.Eyes = shown.Eyes;
            ShowEdges(shape, shown == null ? new double[0] : shown.CornersWM, 1);
        }

        /// <summary>Draws the target from where its eye is, at which the calibrated view has its origin.</summary>
        void ShowTarget(HeadsetState state)
        {
            shownState = state;
            Target shown = state.Target;
            double[] corners = shown == null ? new double[0] : (double[])shown.CornersVM.Clone();
            Projection one = shown == null ? null : state.ProjectionOf(shown.Eye);
            double[] eye = one == null ? new double[3] : Matrices.EyeInV(one.Drawn(state.IsOffline));
            for (int i = 0; i < corners.Length; i++) corners[i] -= eye[i % 3];
            if (shown != null) target.Eyes = shown.Eye;
            ShowEdges(target, corners, -1);
        }

        /// <summary>Draws a quadrilateral or a cube. Of OpenGL's camera axes, z turns as well.</summary>
        static void ShowEdges(Strokes strokes, double[] cornersM, int zSign)
        {
            int[] edges = cornersM.Length == 24 ? Cube : cornersM.Length == 12 ? Quadrilateral : new int[0];
            var corners = new Vector3[cornersM.Length / 3];
            for (int i = 0; i < corners.Length; i++)
                corners[i] = new Vector3(
                    (float)cornersM[3 * i], -(float)cornersM[3 * i + 1], zSign * (float)cornersM[3 * i + 2]);
            strokes.Begin(edges.Length / 2);
            for (int i = 0; i < edges.Length; i += 2) strokes.Set(i / 2, corners[edges[i]], corners[edges[i + 1]]);
            strokes.End();
        }

        /// <summary>Point i, from OpenCV's axes to Unity's.</summary>
        static Vector3 Unity(float[] positionsM, int i)
        {
            return new Vector3(positionsM[3 * i], -positionsM[3 * i + 1], positionsM[3 * i + 2]);
        }
    }
}
