using System;
using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>Eyes, numbered as in handcal.proto; a set of them is their sum.</summary>
    [Flags]
    public enum Eyes
    {
        None = 0,
        Left = 1,
        Right = 2,
        Both = 3,
    }

    /// <summary>The messages of an Envelope, numbered as in handcal.proto.</summary>
    public enum Body
    {
        None = 0,
        Hello = 1,
        Poses = 2,
        Confirm = 3,
        Pong = 4,
        Welcome = 5,
        Ping = 6,
        Cursor = 7,
        LiveHand = 8,
        Prompt = 9,
        Projection = 10,
        Ack = 11,
        Bye = 12,
        Target = 13,
        Retry = 14,
        Refused = 15,
        Device = 16,
        Shape = 17,
        Show = 18,
        Verify = 19,
        Nudge = 20,
        Pair = 21,
        Paired = 22,
    }

    /// <summary>Points of frame W: each is origin + 0.1 mm × (x, y, z).</summary>
    public sealed class Points
    {
        public const int Max = 50000;
        public static readonly Points Nothing = new Points();
        const double QuantumM = 1e-4;
        readonly double[] originM = new double[3];
        readonly byte[] offsets = new byte[0];

        Points() { }

        internal Points(ProtoReader reader)
        {
            var origin = new List<double>();
            while (reader.Next(out int field))
            {
                if (field == 1) reader.Doubles(origin);
                else if (field == 2) offsets = reader.Bytes();
            }
            originM = Check.Finite(origin, 3);
            if (offsets.Length % 6 != 0 || offsets.Length > 6 * Max)
                throw new MalformedException("points of a wrong size");
        }

        public int Count { get { return offsets.Length / 6; } }

        /// <summary>The three numbers of the origin, and the offsets as they came: for the digest.</summary>
        public double[] OriginM { get { return originM; } }
        public byte[] Offsets { get { return offsets; } }

        /// <summary>Writes every point's x, y and z: point i to place 3 (first + i · step).</summary>
        public void CopyTo(float[] positionsM, int first, int step)
        {
            double x = originM[0], y = originM[1], z = originM[2];
            int to = 3 * first, skip = 3 * step, end = offsets.Length;
            for (int from = 0; from < end; from += 6, to += skip)
            {
                positionsM[to] = (float)(x + QuantumM * (short)(offsets[from] | offsets[from + 1] << 8));
                positionsM[to + 1] = (float)(y + QuantumM * (short)(offsets[from + 2] | offsets[from + 3] << 8));
                positionsM[to + 2] = (float)(z + QuantumM * (short)(offsets[from + 4] | offsets[from + 5] << 8));
            }
        }
    }

    /// <summary>The frozen hand to align with, as it came.</summary>
    public sealed class Cursor
    {
        public readonly uint Id;
        public readonly Points Points = Points.Nothing;

        /// <summary>The eyes that draw it.</summary>
        public readonly Eyes Eyes;

        internal Cursor(ProtoReader reader)
        {
            var eyes = new List<ulong>();
            while (reader.Next(out int field))
            {
                if (field == 1) Id = (uint)reader.Number();
                else if (field == 2) Points = new Points(reader.Message());
                else if (field == 3) reader.Numbers(eyes);
            }
            Eyes = Check.EyesOrBoth(eyes);
        }
    }

    /// <summary>The projection and view of an eye; matrices by rows, OpenCV axes.</summary>
    public sealed class Projection
    {
        const int MaxDisplayPx = 65535;
        const int MaxTextCharacters = 200;
        public readonly Eyes Eye;

        /// <summary>3×4, pixels from points in V.</summary>
        public readonly double[] P;

        /// <summary>3×4, the offline calibration.</summary>
        public readonly double[] POffline;

        /// <summary>The upper 3×4 of the rig's view.</summary>
        public readonly double[] TVH;

        public readonly int WidthPx, HeightPx;
        public readonly string Wearer = "", Rig = "";

        internal Projection(ProtoReader reader)
        {
            List<double> p = new List<double>(), offline = new List<double>(), view = new List<double>();
            ulong eye = 0, width = 0, height = 0;
            while (reader.Next(out int field))
            {
                switch (field)
                {
                    case 1: eye = reader.Number(); break;
                    case 2: reader.Doubles(p); break;
                    case 3: width = reader.Number(); break;
                    case 4: height = reader.Number(); break;
                    case 5: reader.Doubles(view); break;
                    case 6: reader.Doubles(offline); break;
                    case 7: Wearer = Check.Text(reader.Text(), MaxTextCharacters); break;
                    case 8: Rig = Check.Text(reader.Text(), MaxTextCharacters); break;
                }
            }
            Eye = Check.OneEye(eye);
            P = Check.Finite(p, 12);
            POffline = offline.Count == 0 ? P : Check.Finite(offline, 12);
            TVH = Check.Rigid(view);
            if (width == 0 || height == 0 || width > MaxDisplayPx || height > MaxDisplayPx)
                throw new MalformedException("a display of an impossible size");
            WidthPx = (int)width;
            HeightPx = (int)height;
        }

        /// <summary>The matrix that is drawn with.</summary>
        public double[] Drawn(bool isOffline)
        {
            return isOffline ? POffline : P;
        }

        internal ProtoWriter Write()
        {
            return new ProtoWriter()
                .Number(1, (ulong)Eye).Doubles(2, P)
                .Number(3, (ulong)WidthPx).Number(4, (ulong)HeightPx)
                .Doubles(5, TVH).Doubles(6, POffline).Text(7, Wearer).Text(8, Rig);
        }
    }

    /// <summary>The user test's target: four corners in V, for one eye.</summary>
    public sealed class Target
    {
        public readonly Eyes Eye;

        /// <summary>x, y, z of four corners.</summary>
        public readonly double[] CornersVM;

        internal Target(Eyes eye, double[] cornersVM)
        {
            Eye = eye;
            CornersVM = cornersVM;
        }

        /// <summary>Null if the target is removed.</summary>
        internal static Target Read(ProtoReader reader)
        {
            ulong eye = 0;
            var corners = new List<double>();
            while (reader.Next(out int field))
            {
                if (field == 1) eye = reader.Number();
                else if (field == 2) reader.Doubles(corners);
            }
            if (corners.Count == 0) return null;
            return new Target(Check.OneEye(eye), Check.Finite(corners, 12));
        }
    }

    /// <summary>A shape fixed in the world: 4 corners of a quadrilateral, or 8 of a cube.</summary>
    public sealed class Shape
    {
        /// <summary>x, y, z of each corner.</summary>
        public readonly double[] CornersWM;
        public readonly Eyes Eyes;

        Shape(double[] cornersWM, Eyes eyes)
        {
            CornersWM = cornersWM;
            Eyes = eyes;
        }

        /// <summary>Null if the shape is removed.</summary>
        internal static Shape Read(ProtoReader reader)
        {
            var eyes = new List<ulong>();
            var corners = new List<double>();
            while (reader.Next(out int field))
            {
                if (field == 1) reader.Doubles(corners);
                else if (field == 2) reader.Numbers(eyes);
            }
            if (corners.Count == 0) return null;
            if (corners.Count != 12 && corners.Count != 24)
                throw new MalformedException("a shape with neither 4 corners nor 8");
            return new Shape(Check.Finite(corners, corners.Count), Check.EyesOrBoth(eyes));
        }
    }

    /// <summary>The eye whose drawing the wearer is to move, and the steps of a press.</summary>
    public sealed class Verify
    {
        public readonly uint Id;
        public readonly Eyes Eye;
        public readonly double StepArcmin, StepSize;

        Verify(uint id, Eyes eye, double stepArcmin, double stepSize)
        {
            Id = id;
            Eye = eye;
            StepArcmin = stepArcmin;
            StepSize = stepSize;
        }

        /// <summary>Null if there is nothing to verify.</summary>
        internal static Verify Read(ProtoReader reader)
        {
            uint id = 0;
            ulong eye = 0;
            double arcmin = 0, size = 0;
            while (reader.Next(out int field))
            {
                switch (field)
                {
                    case 1: id = (uint)reader.Number(); break;
                    case 2: eye = reader.Number(); break;
                    case 3: arcmin = reader.Double(); break;
                    case 4: size = reader.Double(); break;
                }
            }
            if (id == 0) return null;
            if (!(arcmin > 0 && size > 0) || double.IsInfinity(arcmin + size))
                throw new MalformedException("steps of a verification that are not positive");
            return new Verify(id, Check.OneEye(eye), arcmin, size);
        }
    }

    static class Check
    {
        const double ReachM = 1e3;
        const double RotationTolerance = 1e-5;

        public static double[] Finite(List<double> values, int count)
        {
            bool isFinite = values.Count == count;
            foreach (double value in values) isFinite &= !double.IsNaN(value) && !double.IsInfinity(value);
            if (!isFinite) throw new MalformedException("expected " + count + " finite numbers");
            return values.ToArray();
        }

        /// <summary>The upper 3×4 of a rotation and a translation.</summary>
        public static double[] Rigid(List<double> values)
        {
            double[] t = Finite(values, 12);
            bool isRigid = true;
            for (int i = 0; i < 3; i++)
            {
                isRigid &= Math.Abs(t[4 * i + 3]) < ReachM;
                for (int j = 0; j < 3; j++)
                {
                    double dot = 0;
                    for (int k = 0; k < 3; k++) dot += t[4 * i + k] * t[4 * j + k];
                    isRigid &= Math.Abs(dot - (i == j ? 1 : 0)) < RotationTolerance;
                }
            }
            double determinant = t[0] * (t[5] * t[10] - t[6] * t[9])
                - t[1] * (t[4] * t[10] - t[6] * t[8]) + t[2] * (t[4] * t[9] - t[5] * t[8]);
            if (!isRigid || determinant < 0)
                throw new MalformedException("a pose that is not a rotation and a translation");
            return t;
        }

        public static Eyes OneEye(ulong code)
        {
            if (code != (ulong)Eyes.Left && code != (ulong)Eyes.Right)
                throw new MalformedException("unknown eye " + code);
            return (Eyes)code;
        }

        /// <summary>A list of eyes; none listed means both.</summary>
        public static Eyes EyesOrBoth(List<ulong> codes)
        {
            if (codes.Count > 2) throw new MalformedException("more eyes than two");
            var eyes = Eyes.None;
            foreach (ulong code in codes) eyes |= OneEye(code);
            return eyes == Eyes.None ? Eyes.Both : eyes;
        }

        public static string Text(string text, int maxCharacters)
        {
            bool isPlain = text.Length <= 2 * maxCharacters;  // UTF-16, two for some characters
            foreach (char character in text) isPlain &= character >= ' ';
            if (!isPlain) throw new MalformedException("a text that is too long, or with control characters");
            return text;
        }
    }
}
