using System;
using Handcal.Link;
using UnityEngine;
using UnityEngine.Rendering;

namespace Handcal
{
    /// <summary>
    /// Straight strokes of a constant width in pixels; one without length is a square dot. Each has
    /// four vertices, which the shader moves apart: position is the own end, normal the other one.
    /// </summary>
    sealed class Strokes : IDisposable
    {
        const float AnywhereM = 1e4f;
        readonly GameObject holder;
        readonly Mesh mesh;
        readonly Material material;
        Vector3[] ends = new Vector3[0], others = new Vector3[0];
        int[] indices = new int[0];
        int count;

        public Strokes(string name, Transform parent, Color color, float widthPx, bool isInView)
        {
            holder = new GameObject("handcal " + name);
            holder.transform.SetParent(parent, false);
            mesh = new Mesh { indexFormat = IndexFormat.UInt32 };
            mesh.MarkDynamic();
            holder.AddComponent<MeshFilter>().sharedMesh = mesh;
            material = new Material(Resources.Load<Shader>("HandcalStroke"));
            material.SetFloat("_WidthPx", widthPx);
            material.SetFloat("_IsInView", isInView ? 1 : 0);
            var renderer = holder.AddComponent<MeshRenderer>();
            renderer.sharedMaterial = material;
            renderer.shadowCastingMode = ShadowCastingMode.Off;
            Color = color;
            Eyes = Eyes.Both;
        }

        public Color Color { set { material.SetColor("_Color", value); } }

        /// <summary>The eyes that draw the strokes.</summary>
        public Eyes Eyes { set { material.SetFloat("_Eyes", (int)value); } }

        /// <summary>Says which eye is rendered next; else the shader asks Unity.</summary>
        public void BeginEye(Eyes eye)
        {
            material.SetFloat("_Eye", (int)eye);
        }

        /// <summary>Draws in the space of this parent.</summary>
        public Transform Parent { set { holder.transform.SetParent(value, false); } }

        public void Begin(int strokes)
        {
            if (ends.Length < 4 * strokes) Grow(Math.Max(4 * strokes, 2 * ends.Length));
            if (strokes != count) mesh.SetIndices(indices, 0, 6 * strokes, MeshTopology.Triangles, 0, false);
            count = strokes;
        }

        public void Set(int stroke, Vector3 from, Vector3 to)
        {
            int at = 4 * stroke;
            ends[at] = ends[at + 1] = others[at + 2] = others[at + 3] = from;
            ends[at + 2] = ends[at + 3] = others[at] = others[at + 1] = to;
        }

        public void End()
        {
            mesh.vertices = ends;
            mesh.normals = others;
        }

        public void Dispose()
        {
            UnityEngine.Object.Destroy(holder);
            UnityEngine.Object.Destroy(mesh);
            UnityEngine.Object.Destroy(material);
        }

        void Grow(int vertices)
        {
            Array.Resize(ref ends, vertices);
            Array.Resize(ref others, vertices);
            indices = Indices(vertices / 4);
            var corners = new Vector2[vertices];
            for (int i = 0; i < vertices; i++) corners[i] = new Vector2(i % 4 < 2 ? -1 : 1, i % 2 == 0 ? -1 : 1);
            mesh.Clear();
            mesh.vertices = ends;
            mesh.normals = others;
            mesh.uv = corners;
            mesh.bounds = new Bounds(Vector3.zero, AnywhereM * Vector3.one);  // never culled
        }

        static int[] Indices(int strokes)
        {
            var indices = new int[6 * strokes];
            for (int i = 0; i < strokes; i++)
            {
                int at = 6 * i, vertex = 4 * i;
                indices[at] = vertex;
                indices[at + 1] = indices[at + 4] = vertex + 1;
                indices[at + 2] = indices[at + 3] = vertex + 2;
                indices[at + 5] = vertex + 3;
            }
            return indices;
        }
    }
}
