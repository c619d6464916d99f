using System;

namespace Handcal.Link
{
    /// <summary>
    /// Conversions between handcal's matrices (OpenCV axes: x right, y down, z forward; pixel
    /// centres at whole numbers) and Unity's. All matrices are lists of numbers by rows.
    /// </summary>
    public static class Matrices
    {
        /// <summary>
        /// The 4×4 for Camera.SetStereoProjectionMatrix: from the eye, in OpenGL's axes of V (x right,
        /// y up, z back), to clip space. The view holds the eye's place; here it would make the last
        /// number other than 0, which shaders take for an orthographic camera.
        /// </summary>
        public static double[] UnityProjection(double[] P, int widthPx, int heightPx, double nearM, double farM)
        {
            double scale = 1 / Math.Sqrt(P[8] * P[8] + P[9] * P[9] + P[10] * P[10]);
            double zScale = (farM + nearM) / (farM - nearM), zOffset = -2 * farM * nearM / (farM - nearM);
            var clip = new double[16];
            for (int i = 0; i < 3; i++)
            {
                double u = scale * P[i], v = scale * P[4 + i], depth = scale * P[8 + i];
                double sign = i == 0 ? 1 : -1;  // from OpenGL's axes to OpenCV's
                clip[i] = sign * (2 * (u + 0.5 * depth) / widthPx - depth);
                clip[4 + i] = sign * (depth - 2 * (v + 0.5 * depth) / heightPx);
                clip[8 + i] = sign * zScale * depth;
                clip[12 + i] = sign * depth;
            }
            clip[11] = zOffset;
            return clip;
        }

        /// <summary>
        /// The 4×4 for Camera.SetStereoViewMatrix, to be multiplied with the head's worldToLocal:
        /// from Unity's axes of the head to the eye, in OpenGL's axes of V.
        /// </summary>
        public static double[] UnityViewFromHead(double[] TVH, double[] P)
        {
            double[] eye = EyeInV(P);
            var view = new double[16];
            for (int row = 0; row < 3; row++)
                for (int column = 0; column < 4; column++)
                    view[4 * row + column] = (row == 0 ? 1 : -1) * (column == 1 ? -1 : 1)
                        * (TVH[4 * row + column] - (column == 3 ? eye[row] : 0));
            view[15] = 1;
            return view;
        }

        /// <summary>
        /// One eye for OpenXR, in its axes (x right, y up, z back): its place in V, the tangents left,
        /// right, up and down of its field of view, and the pose of V in the head, a quaternion and
        /// metres. Null if P has skew or rotation, which OpenXR cannot express.
        /// </summary>
        public static double[] OpenXr(double[] P, double[] TVH, int widthPx, int heightPx)
        {
            double fx = P[0] / P[10], fy = P[5] / P[10], cx = P[2] / P[10], cy = P[6] / P[10];
            double skew = Math.Abs(P[1] / P[0]) + Math.Abs(P[4] / P[5]) + Math.Abs(P[8] / P[10]) + Math.Abs(P[9] / P[10]);
            if (!(skew < 1e-9)) return null;
            double[] eye = EyeInV(P), m = Invert(TVH);
            return new[]
            {
                eye[0], -eye[1], -eye[2],
                (-0.5 - cx) / fx, (widthPx - 0.5 - cx) / fx, (cy + 0.5) / fy, (cy + 0.5 - heightPx) / fy,
                Part(1 + m[0] - m[5] - m[10], m[9] - m[6]), Part(1 - m[0] + m[5] - m[10], m[8] - m[2]),
                Part(1 - m[0] - m[5] + m[10], m[1] - m[4]), Part(1 + m[0] + m[5] + m[10], 1),
                m[3], -m[7], -m[11],
            };
        }

        /// <summary>A part of a quaternion, from four times its square and its sign.</summary>
        static double Part(double square, double sign)
        {
            return (sign < 0 ? -0.5 : 0.5) * Math.Sqrt(Math.Max(0, square));
        }

        /// <summary>The eye, P's centre of projection, in V; by Cramer's rule.</summary>
        public static double[] EyeInV(double[] P)
        {
            double det = Minor(P, 0, 1, 2);
            return new[] { -Minor(P, 3, 1, 2) / det, -Minor(P, 0, 3, 2) / det, -Minor(P, 0, 1, 3) / det };
        }

        /// <summary>The determinant of three columns of P.</summary>
        static double Minor(double[] P, int a, int b, int c)
        {
            return P[a] * (P[4 + b] * P[8 + c] - P[4 + c] * P[8 + b])
                - P[b] * (P[4 + a] * P[8 + c] - P[4 + c] * P[8 + a])
                + P[c] * (P[4 + a] * P[8 + b] - P[4 + b] * P[8 + a]);
        }

        /// <summary>
        /// The upper 3×4 in OpenCV's axes of a pose given as Unity's position and quaternion; the
        /// quaternion, which float32 leaves a little long or short, is normalised.
        /// </summary>
        public static double[] FromUnity(
            double x, double y, double z, double qx, double qy, double qz, double qw)
        {
            double norm = Math.Sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
            // Mirrored in y: the axis of a rotation mirrors, and its sense turns.
            double a = -qx / norm, b = qy / norm, c = -qz / norm, w = qw / norm;
            return new[]
            {
                1 - 2 * (b * b + c * c), 2 * (a * b - c * w), 2 * (a * c + b * w), x,
                2 * (a * b + c * w), 1 - 2 * (a * a + c * c), 2 * (b * c - a * w), -y,
                2 * (a * c - b * w), 2 * (b * c + a * w), 1 - 2 * (a * a + b * b), z,
            };
        }

        /// <summary>The inverse of a rotation and a translation, and their product.</summary>
        public static double[] Invert(double[] T)
        {
            var inverse = new double[12];
            for (int row = 0; row < 3; row++)
                for (int k = 0; k < 3; k++)
                {
                    inverse[4 * row + k] = T[4 * k + row];
                    inverse[4 * row + 3] -= T[4 * k + row] * T[4 * k + 3];
                }
            return inverse;
        }

        public static double[] Multiply(double[] A, double[] B)
        {
            var product = new double[12];
            for (int row = 0; row < 3; row++)
                for (int column = 0; column < 4; column++)
                {
                    double sum = column == 3 ? A[4 * row + 3] : 0;
                    for (int k = 0; k < 3; k++) sum += A[4 * row + k] * B[4 * k + column];
                    product[4 * row + column] = sum;
                }
            return product;
        }

        /// <summary>
        /// Distance from V of the plane in which every point has one pixel in both projections: the
        /// display's virtual image, and the place for the compositor's focus plane. 0 if the
        /// projections are too alike to tell; then the plane does not matter.
        /// </summary>
        public static double FocusDistanceM(double[] P, double[] POffline, int widthPx, int heightPx)
        {
            double slopes = 0, products = 0;
            foreach (double u in new[] { 0.0, widthPx - 1.0 })
                foreach (double v in new[] { 0.0, heightPx - 1.0 })
                {
                    double[] one = Ray(P, u, v), other = Ray(POffline, u, v);
                    for (int axis = 0; axis < 2; axis++)
                    {
                        double slope = one[2 + axis] - other[2 + axis];
                        slopes += slope * slope;
                        products += slope * (one[axis] - other[axis]);
                    }
                }
            return slopes < 1e-12 ? 0 : Math.Max(0, -products / slopes);
        }

        /// <summary>The line of a pixel: x and y at z = 0 in V, and their slopes over z.</summary>
        static double[] Ray(double[] P, double u, double v)
        {
            // A pixel gives two planes: (P1 - u P3) · p = 0 and (P2 - v P3) · p = 0.
            double a = P[0] - u * P[8], b = P[1] - u * P[9], c = P[2] - u * P[10], d = P[3] - u * P[11];
            double e = P[4] - v * P[8], f = P[5] - v * P[9], g = P[6] - v * P[10], h = P[7] - v * P[11];
            double det = a * f - b * e;
            return new[]
            {
                (b * h - d * f) / det, (d * e - a * h) / det,
                (b * g - c * f) / det, (c * e - a * g) / det,
            };
        }
    }
}
