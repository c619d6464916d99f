// See UnityEngine.cs.
using System;

namespace UnityEngine
{
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
        public static Vector3 Normalize(Vector3 a) { return (float)(1 / Math.Sqrt(a.x * a.x + a.y * a.y + a.z * a.z)) * a; }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return a + -b; }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a) { return new Vector3(-a.x, -a.y, -a.z); }
        public static Vector3 operator *(float d, Vector3 a) { return new Vector3(d * a.x, d * a.y, d * a.z); }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity { get { return new Quaternion(0, 0, 0, 1); } }

        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(
                a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
                a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }

        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            return Matrix4x4.TRS(Vector3.zero, q, Vector3.one).MultiplyPoint3x4(v);
        }
    }

    public struct Mathf
    {
        public static float Abs(float f) { return Math.Abs(f); }
        public static float Min(float a, float b) { return Math.Min(a, b); }
        public static float Max(float a, float b) { return Math.Max(a, b); }
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
        double[] all;  // by rows

        public float this[int row, int column]
        {
            get { return all == null ? 0 : (float)all[4 * row + column]; }
            set { all = all ?? new double[16]; all[4 * row + column] = value; }
        }

        public static Matrix4x4 identity { get { return TRS(Vector3.zero, Quaternion.identity, Vector3.one); } }

        public static Matrix4x4 TRS(Vector3 p, Quaternion q, Vector3 s)
        {
            double x = q.x, y = q.y, z = q.z, w = q.w;
            return new Matrix4x4
            {
                all = new double[]
                {
                    s.x * (1 - 2 * (y * y + z * z)), s.y * 2 * (x * y - z * w), s.z * 2 * (x * z + y * w), p.x,
                    s.x * 2 * (x * y + z * w), s.y * (1 - 2 * (x * x + z * z)), s.z * 2 * (y * z - x * w), p.y,
                    s.x * 2 * (x * z - y * w), s.y * 2 * (y * z + x * w), s.z * (1 - 2 * (x * x + y * y)), p.z,
                    0, 0, 0, 1,
                },
            };
        }

        public static Matrix4x4 operator *(Matrix4x4 a, Matrix4x4 b)
        {
            var product = new Matrix4x4 { all = new double[16] };
            for (int i = 0; i < 16; i++)
                for (int k = 0; k < 4; k++) product.all[i] += a.all[i / 4 * 4 + k] * b.all[4 * k + i % 4];
            return product;
        }

        public Vector3 MultiplyPoint3x4(Vector3 p)
        {
            return new Vector3(Row(0, p), Row(1, p), Row(2, p));
        }

        public Vector3 MultiplyPoint(Vector3 p)
        {
            return 1 / Row(3, p) * MultiplyPoint3x4(p);
        }

        /// <summary>The inverse, by Gauss and Jordan.</summary>
        public Matrix4x4 inverse
        {
            get
            {
                var a = (double[])all.Clone();
                Matrix4x4 found = identity;
                double[] b = found.all;
                for (int c = 0; c < 4; c++)
                {
                    int pivot = c;
                    for (int r = c; r < 4; r++) if (Math.Abs(a[4 * r + c]) > Math.Abs(a[4 * pivot + c])) pivot = r;
                    for (int k = 0; k < 4; k++)
                    {
                        Swap(a, 4 * c + k, 4 * pivot + k);
                        Swap(b, 4 * c + k, 4 * pivot + k);
                    }
                    double scale = 1 / a[5 * c];
                    for (int k = 0; k < 4; k++)
                    {
                        a[4 * c + k] *= scale;
                        b[4 * c + k] *= scale;
                    }
                    for (int r = 0; r < 4; r++)
                    {
                        double factor = r == c ? 0 : a[4 * r + c];
                        for (int k = 0; k < 4; k++)
                        {
                            a[4 * r + k] -= factor * a[4 * c + k];
                            b[4 * r + k] -= factor * b[4 * c + k];
                        }
                    }
                }
                return found;
            }
        }

        float Row(int row, Vector3 p)
        {
            return (float)(all[4 * row] * p.x + all[4 * row + 1] * p.y + all[4 * row + 2] * p.z + all[4 * row + 3]);
        }

        static void Swap(double[] one, int i, int k)
        {
            double kept = one[i];
            one[i] = one[k];
            one[k] = kept;
        }
    }
}
