using System;
using System.Globalization;
using System.IO;
using System.Text;

namespace Handcal.Link.Tests
{
    /// <summary>A headset whose head, eyes and hand are moved by the program that starts it.</summary>
    sealed class Remote
    {
        readonly HeadsetLink link;
        HeadsetState told;
        int toldLive = -1;
        Outgoing sent;

        /// <summary>
        /// Arguments: run, host, port, key, identity, name, offset and rate of its clock, and the
        /// file of kept projections, which may not exist.
        /// </summary>
        public Remote(string[] arguments)
        {
            double offsetNs = Number(arguments[6]), rate = Number(arguments[7]);
            var kept = File.Exists(arguments[8]) ? Kept.FromBytes(File.ReadAllBytes(arguments[8])) : new Kept();
            link = new HeadsetLink(
                arguments[1],
                int.Parse(arguments[2]),
                Encoding.UTF8.GetBytes(arguments[3]),
                ulong.Parse(arguments[4], NumberStyles.HexNumber),
                new Device { Name = arguments[5], Runtime = "mono", App = "test" },
                kept,
                () => (long)(offsetNs + rate * (System.Diagnostics.Stopwatch.GetTimestamp() * 100.0)));
            keptPath = arguments[8];
        }

        readonly string keptPath;

        /// <summary>Does what each line says until there is no more; answers `state` in one line.</summary>
        public void Run()
        {
            string line;
            while ((line = Console.ReadLine()) != null)
            {
                string[] words = line.Split(' ');
                switch (words[0])
                {
                    case "pose": link.SendPose(Numbers.Read(line.Substring(line.IndexOf(' ', 5) + 1)), Time(words)); break;
                    case "confirm": sent = link.Confirm(Time(words), told); break;
                    case "nudge":
                        var moved = new NudgeSum
                        {
                            RightArcmin = Number(words[2]),
                            DownArcmin = Number(words[3]),
                            Size = Number(words[4]),
                        };
                        sent = link.Nudge(Time(words), told, moved, Number(words[5]) > 0);
                        break;
                    case "kept": link.ShowKept(words[1]); break;
                    case "state": Tell(); break;
                }
            }
            byte[] kept = link.TakeKept();
            if (kept != null) File.WriteAllBytes(keptPath, kept);
            link.Dispose();
        }

        /// <summary>Tells the state; points only if they have changed since they were told.</summary>
        void Tell()
        {
            HeadsetState state = link.State();
            bool isNewCursor = told == null || told.Cursor != state.Cursor;
            bool isNewLive = told == null || told.Live != state.Live || (state.Live != null && toldLive != state.Live.Version);
            told = state;
            toldLive = state.Live == null ? -1 : state.Live.Version;
            var answer = new StringBuilder();
            Add(answer, "connected", link.IsConnected ? "1" : "0");
            Add(answer, "dismissed", link.IsDismissed ? "1" : "0");
            Add(answer, "problem", Base64(Encoding.UTF8.GetBytes(link.Problem)));
            Add(answer, "sent", sent == null ? "None" : sent.State.ToString());
            foreach (Rejection reason in Enum.GetValues(typeof(Rejection)))
                Add(answer, reason.ToString(), link.Rejected(reason).ToString(CultureInfo.InvariantCulture));
            Add(answer, "wearers", Base64(Encoding.UTF8.GetBytes(string.Join("\n", link.KeptWearers()))));
            Add(answer, "prompt", Base64(Encoding.UTF8.GetBytes(state.Prompt)));
            Add(answer, "open", ((int)state.OpenEyes).ToString());
            Add(answer, "offline", state.IsOffline ? "1" : "0");
            foreach (Projection one in new[] { state.Left, state.Right })
                if (one != null)
                    Add(answer, one.Eye.ToString(), Base64(one.P) + "," + Base64(one.TVH) + "," + Base64(one.POffline)
                        + "," + one.WidthPx + "," + one.HeightPx + ","
                        + Base64(Encoding.UTF8.GetBytes(one.Wearer)) + "," + Base64(Encoding.UTF8.GetBytes(one.Rig)));
            if (isNewCursor) Add(answer, "cursor", Cursor(state.Cursor));
            if (isNewLive) Add(answer, "live", Live(state.Live));
            if (state.Target != null) Add(answer, "target", (int)state.Target.Eye + "," + Base64(state.Target.CornersVM));
            if (state.Shape != null) Add(answer, "shape", (int)state.Shape.Eyes + "," + Base64(state.Shape.CornersWM));
            Verify verify = state.Verify;
            if (verify != null)
                Add(answer, "verify", verify.Id + "," + (int)verify.Eye + "," + Base64(new[] { verify.StepArcmin, verify.StepSize }));
            Console.WriteLine(answer);
        }

        static string Live(LiveHand live)
        {
            if (live == null) return "0,0,3,";
            var points = new float[3 * live.Count];
            Array.Copy(live.PositionsM, points, points.Length);
            return (live.IsRed ? 1 : 0) + "," + (live.IsOutline ? 1 : 0) + "," + (int)live.Eyes + "," + Base64(points);
        }

        static string Cursor(Cursor cursor)
        {
            if (cursor == null) return "0,3,";
            var points = new float[3 * cursor.Points.Count];
            cursor.Points.CopyTo(points, 0, 1);
            return cursor.Id + "," + (int)cursor.Eyes + "," + Base64(points);
        }

        static void Add(StringBuilder answer, string name, string value)
        {
            answer.Append(name).Append('=').Append(value).Append(' ');
        }

        static string Base64(Array numbers)
        {
            var bytes = new byte[Buffer.ByteLength(numbers)];
            Buffer.BlockCopy(numbers, 0, bytes, 0, bytes.Length);
            return Convert.ToBase64String(bytes);
        }

        static long Time(string[] words)
        {
            return long.Parse(words[1], CultureInfo.InvariantCulture);
        }

        static double Number(string text)
        {
            return double.Parse(text, CultureInfo.InvariantCulture);
        }
    }
}
