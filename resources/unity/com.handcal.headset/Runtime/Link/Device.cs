using System;
using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>One eye's rendering camera V, as the runtime reports it.</summary>
    public sealed class View
    {
        public Eyes Eye;

        /// <summary>The upper 3×4, by rows; OpenCV axes.</summary>
        public double[] TVH;

        /// <summary>Left, right, up and down edge of the field of view: x/z or y/z in V.</summary>
        public double[] Tangents;

        public int WidthPx, HeightPx;
    }

    /// <summary>The headset introduces itself with this.</summary>
    public sealed class Device
    {
        const int MaxTextCharacters = 40;
        public string Name = "", Runtime = "", App = "";
        public List<View> Views = new List<View>();

        /// <summary>0 if unknown.</summary>
        public double EyeDistanceM;

        internal ProtoWriter Write(string shownWearer, string shownRig)
        {
            var writer = new ProtoWriter()
                .Text(1, Short(Name)).Text(2, Short(Runtime)).Text(3, Short(App))
                .Number(4, Datagram.Version);
            foreach (View view in Views)
                writer.Message(5, new ProtoWriter()
                    .Number(1, (ulong)view.Eye).Doubles(2, view.TVH).Doubles(3, view.Tangents)
                    .Number(4, (ulong)view.WidthPx).Number(5, (ulong)view.HeightPx));
            return writer.Double(6, EyeDistanceM).Text(7, shownWearer).Text(8, shownRig);
        }

        /// <summary>A text as the PC takes it: at most 40 characters in one line.</summary>
        public static string Short(string text)
        {
            var plain = new System.Text.StringBuilder();
            foreach (char character in text ?? "")
                plain.Append(character < ' ' || char.IsSurrogate(character) ? ' ' : character);
            return plain.ToString(0, Math.Min(plain.Length, MaxTextCharacters));
        }
    }
}
