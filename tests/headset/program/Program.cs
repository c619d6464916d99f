using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using System.Security.Cryptography;
using System.Text;
using System.Threading;

namespace Handcal.Link.Tests
{
    /// <summary>Runs one test of the headset's side of the link, named by the first argument.</summary>
    static class Program
    {
        static int Main(string[] arguments)
        {
            CultureInfo.CurrentCulture = new CultureInfo("de-DE");  // a decimal comma changes nothing
            switch (arguments[0])
            {
                case "vectors": Vectors.Print(Console.In); break;
                case "matrices": Lines(Numbers.Matrices); break;
                case "pose": Lines(Numbers.Pose); break;
                case "focus": Lines(Numbers.Focus); break;
                case "invitation": Lines(Invited); break;
                case "exchange": Console.WriteLine(Vectors.Exchanged(Console.In)); break;
                case "pair": Console.WriteLine(Paired(arguments)); break;
                case "hostile": Lines(Hostile); break;
                case "run": new Remote(arguments).Run(); break;
                case "time": Timing.Run(arguments); break;
                case "made":
                    using (var random = RandomNumberGenerator.Create()) Console.WriteLine(random.GetType());
                    using (var hash = SHA256.Create()) Console.WriteLine(hash.GetType());
                    using (var hash = HashAlgorithm.Create(new HMACSHA256().HashName)) Console.WriteLine(hash.GetType());
                    break;
                case "frames": Timing.Frames(int.Parse(arguments[1])); break;
                default: return 2;
            }
            return 0;
        }

        static void Lines(Func<string, string> answer)
        {
            string line;
            while ((line = Console.ReadLine()) != null) Console.WriteLine(answer(line));
        }

        static string Invited(string text)
        {
            if (!Invitation.TryRead(text, out Invitation one)) return "none";
            return one.Host + " " + one.Port + " " + one.Code;
        }

        /// <summary>Arguments: host, port, digits or an invitation's text, identity. Returns the key or the problem.</summary>
        static string Paired(string[] arguments)
        {
            ulong device = ulong.Parse(arguments[4], NumberStyles.HexNumber);
            string problem;
            byte[] key = Invitation.TryRead(arguments[3], out Invitation scanned)
                ? Exchange.PairByCode(scanned, device, "Lab-2", 5, out problem)
                : Exchange.PairByDigits(
                    arguments[1], int.Parse(arguments[2]), arguments[3], device, "Lab-2", 5, out problem);
            return key == null ? problem : Encoding.ASCII.GetString(key);
        }

        /// <summary>Reads any bytes as a payload of the PC; anything but MalformedException is a fault.</summary>
        static string Hostile(string hex)
        {
            try
            {
                var envelope = new ProtoReader(Vectors.Bytes(hex));
                if (!envelope.Next(out int body)) return "empty";
                ProtoReader message = envelope.Message();
                switch ((Body)body)
                {
                    case Body.Projection: new Projection(message); break;
                    case Body.Ack: new Outbox().Acknowledge(message); break;
                    default:
                        var state = new HeadsetState();
                        state.Take((Body)body, message);
                        state.Live?.Decode();
                        break;
                }
                return "taken";
            }
            catch (MalformedException)
            {
                return "malformed";
            }
        }
    }

    /// <summary>Matrices and poses, as numbers in a line.</summary>
    static class Numbers
    {
        public static string Matrices(string line)
        {
            double[] all = Read(line);
            double[] P = Part(all, 0, 12), view = Part(all, 12, 12);
            double[] clip = Link.Matrices.UnityProjection(P, (int)all[24], (int)all[25], all[26], all[27]);
            return Write(clip) + " " + Write(Link.Matrices.UnityViewFromHead(view, P));
        }

        /// <summary>The pose, then its inverse, then their product.</summary>
        public static string Pose(string line)
        {
            double[] n = Read(line);
            double[] pose = Link.Matrices.FromUnity(n[0], n[1], n[2], n[3], n[4], n[5], n[6]);
            double[] inverse = Link.Matrices.Invert(pose);
            return Write(pose) + " " + Write(inverse) + " " + Write(Link.Matrices.Multiply(pose, inverse));
        }

        public static string Focus(string line)
        {
            double[] n = Read(line);
            double distance = Link.Matrices.FocusDistanceM(Part(n, 0, 12), Part(n, 12, 12), (int)n[24], (int)n[25]);
            return Write(new[] { distance });
        }

        public static double[] Read(string line)
        {
            return Array.ConvertAll(line.Split(' '), one => double.Parse(one, CultureInfo.InvariantCulture));
        }

        public static string Write(double[] numbers)
        {
            return string.Join(" ", Array.ConvertAll(numbers, one => one.ToString("R", CultureInfo.InvariantCulture)));
        }

        static double[] Part(double[] all, int start, int count)
        {
            var part = new double[count];
            Array.Copy(all, start, part, 0, count);
            return part;
        }
    }

    /// <summary>The conversation of docs/protocol_vectors.json, from the headset's side.</summary>
    static class Vectors
    {
        const long TimeNs = 1000000000123;

        /// <summary>
        /// Reads pairing key, identity, session, the two nonces and the cookie, then the PC's
        /// datagrams of the session, an empty line, and the datagram that removes the cursor, in
        /// hexadecimal; prints everything that the headset makes of it.
        /// </summary>
        public static void Print(TextReader input)
        {
            byte[] key = Encoding.ASCII.GetBytes(input.ReadLine());
            ulong device = ulong.Parse(input.ReadLine(), NumberStyles.HexNumber);
            ulong session = ulong.Parse(input.ReadLine(), NumberStyles.HexNumber);
            byte[] nonce = Bytes(input.ReadLine()), pcNonce = Bytes(input.ReadLine());
            byte[] cookie = Bytes(input.ReadLine());
            Keys greeting = Keys.OfHandshake(key, device);
            Keys keys = Keys.OfSession(key, device, session, nonce, pcNonce);
            Tell("handshake", Hex(greeting.ToPc) + " " + Hex(greeting.ToHeadset));
            Tell("session", Hex(keys.ToPc) + " " + Hex(keys.ToHeadset));
            var hello = new HMACSHA256(greeting.ToPc);
            foreach (byte[] sent in new[] { new byte[0], cookie })
            {
                byte[] payload = Envelope.Hello(nonce, (ulong)TimeNs + (ulong)Math.Sign(sent.Length), sent, "Lab 2");
                Tell("hello", Seal(hello, 0, device, Slot.Unreliable, payload));
            }

            var state = new HeadsetState();
            Tell("nothing", Hex(state.Digest()));
            var inbox = new HMACSHA256(keys.ToHeadset);
            string line;
            while (!string.IsNullOrEmpty(line = input.ReadLine())) Take(state, inbox, Bytes(line));
            state.Live.Decode();
            state.IsOffline = false;
            Tell("left_eye_only", Hex(new HeadsetState { Left = state.Left }.Digest()));
            Tell("both_and_cursor", Hex(state.Digest()));
            byte[] drawn = state.Digest();
            state.IsOffline = true;
            Tell("both_and_cursor_offline", Hex(state.Digest()));
            TellState(state);

            double[] TVH = state.Left.TVH;
            var own = new Device { Name = "Lab 2", Runtime = "runtime 1", App = "app 3", EyeDistanceM = 0.063 };
            own.Views.Add(new View
            {
                Eye = Eyes.Left,
                TVH = TVH,
                Tangents = new[] { -0.3, 0.31, -0.17, 0.18 },
                WidthPx = 1268,
                HeightPx = 720,
            });
            var receipts = new Inbox();
            receipts.Receive(new Packet { Slot = Slot.Cursor, MessageId = 2, FragmentCount = 1, Bytes = new byte[0] });
            var moved = new NudgeSum().Plus(state.Verify, -4, 2, 2);
            var outgoing = new List<KeyValuePair<Slot, byte[]>>
            {
                Message(Slot.Device, Envelope.Device(own, state.Wearer, state.Rig)),
                Message(Slot.Unreliable, Envelope.Poses(new[] { Envelope.Pose(TimeNs, TVH) })),
                Message(Slot.Unreliable, Envelope.Pong((ulong)TimeNs, TimeNs + 7, TimeNs + 9, 4, 3)),
                Message(Slot.Confirm, Envelope.Confirm(TimeNs, state.Cursor.Id, drawn)),
                Message(Slot.Nudge, Envelope.Nudge(state.Verify.Id, moved, true, TimeNs, drawn)),
                Message(Slot.Unreliable, Envelope.Ack(receipts.TakeReceipts())),
                Message(Slot.Unreliable, Envelope.Bye()),
            };
            var outbox = new HMACSHA256(keys.ToPc);
            for (int i = 0; i < outgoing.Count; i++)
                Tell("to_pc", Seal(outbox, session, (ulong)i + 1, outgoing[i].Key, outgoing[i].Value));
            Take(state, inbox, Bytes(input.ReadLine()));
            state.IsOffline = false;
            Tell("both_and_cursor_removed", Hex(state.Digest()));
        }

        /// <summary>
        /// Reads a code, whether it is that of an invitation, identity, nonce, secret, name and two
        /// answers of the PC; returns both requests and the key.
        /// </summary>
        public static string Exchanged(TextReader input)
        {
            string code = input.ReadLine();
            bool isByCode = bool.Parse(input.ReadLine());
            ulong device = ulong.Parse(input.ReadLine(), NumberStyles.HexNumber);
            var exchange = new Exchange(code, isByCode, device, Bytes(input.ReadLine()), Bytes(input.ReadLine()));
            string name = input.ReadLine(), request = Hex(exchange.Request(name));
            byte[] retry = Bytes(input.ReadLine()), answer = Bytes(input.ReadLine());
            exchange.TryRead(retry, retry.Length, out _, out _);
            request += " " + Hex(exchange.Request(name));
            bool isEnd = exchange.TryRead(answer, answer.Length, out byte[] key, out string problem);
            return request + " " + isEnd + " " + (key == null ? problem : Encoding.ASCII.GetString(key));
        }

        static KeyValuePair<Slot, byte[]> Message(Slot slot, byte[] payload)
        {
            return new KeyValuePair<Slot, byte[]>(slot, payload);
        }

        static void Take(HeadsetState state, HMACSHA256 mac, byte[] datagram)
        {
            Rejection rejection = Datagram.Read(datagram, datagram.Length, out Packet packet);
            bool isOwn = rejection == Rejection.None && Datagram.IsAuthentic(mac, datagram, datagram.Length);
            datagram[datagram.Length - 1] ^= 1;
            bool isChanged = Datagram.IsAuthentic(mac, datagram, datagram.Length);
            Tell("authentic", isOwn + " " + isChanged);
            var envelope = new ProtoReader(datagram, packet.Start, packet.Count);
            envelope.Next(out int body);
            ProtoReader message = envelope.Message();
            if ((Body)body == Body.Projection)
            {
                var one = new Projection(message);
                if (one.Eye == Eyes.Left) state.Left = one;
                else state.Right = one;
            }
            else if ((Body)body != Body.Ping) state.Take((Body)body, message);
        }

        static void TellState(HeadsetState state)
        {
            Tell("wearer", state.Wearer + "|" + state.Rig);
            Tell("prompt", state.Prompt + "|" + state.OpenEyes);
            var cursor = new float[3 * state.Cursor.Points.Count];
            state.Cursor.Points.CopyTo(cursor, 0, 1);
            Tell("cursor", state.Cursor.Eyes + " " + Numbers.Write(Array.ConvertAll(cursor, one => (double)one)));
            LiveHand live = state.Live;
            var hand = new double[3 * live.Count];
            Array.Copy(live.PositionsM, hand, hand.Length);
            Tell("live", live.Eyes + " " + live.IsRed + " " + live.IsOutline + " " + Numbers.Write(hand));
            Tell("left", Numbers.Write(state.Left.P) + " " + state.Left.WidthPx + " " + state.Left.HeightPx);
            Tell("target", state.Target.Eye + " " + Numbers.Write(state.Target.CornersVM));
            Tell("shape", state.Shape.Eyes + " " + Numbers.Write(state.Shape.CornersWM));
            Verify verify = state.Verify;
            Tell("verify", verify.Eye + " " + Numbers.Write(new[] { verify.Id, verify.StepArcmin, verify.StepSize }));
        }

        static string Seal(HMACSHA256 mac, ulong session, ulong sequence, Slot slot, byte[] payload)
        {
            var packet = new Packet
            {
                Slot = slot,
                Session = session,
                Sequence = sequence,
                MessageId = slot == Slot.Unreliable ? 0 : (uint)sequence,
                FragmentCount = 1,
                Bytes = payload,
                Count = payload.Length,
            };
            var datagram = new byte[Datagram.MaxBytes];
            int size = Datagram.Seal(mac, packet, datagram);
            Array.Resize(ref datagram, size);
            return Hex(datagram);
        }

        static void Tell(string what, string value)
        {
            Console.WriteLine(what + "=" + value);
        }

        public static byte[] Bytes(string hex)
        {
            var bytes = new byte[hex.Length / 2];
            for (int i = 0; i < bytes.Length; i++) bytes[i] = Convert.ToByte(hex.Substring(2 * i, 2), 16);
            return bytes;
        }

        static string Hex(byte[] bytes)
        {
            return BitConverter.ToString(bytes).Replace("-", "").ToLowerInvariant();
        }
    }

    /// <summary>Poses 60 times a second and everything decoded, as in a frame of an app.</summary>
    static class Timing
    {
        const double WarmUpS = 3;

        /// <summary>Arguments: host, port, key, seconds. Prints frames, CPU milliseconds and points.</summary>
        public static void Run(string[] arguments)
        {
            double seconds = double.Parse(arguments[4], CultureInfo.InvariantCulture);
            var clock = Stopwatch.StartNew();
            byte[] key = Encoding.ASCII.GetBytes(arguments[3]);
            var process = Process.GetCurrentProcess();
            var TWH = new double[] { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
            using (var link = new HeadsetLink(
                arguments[1], int.Parse(arguments[2]), key, 7, new Device(), new Kept(), () => clock.ElapsedTicks * 100))
            {
                while (!link.IsConnected) Thread.Sleep(1);
                double startS = clock.Elapsed.TotalSeconds, cpuMs = 0;
                long frames = 0, points = 0;
                int version = 0;
                for (double nextS = startS; nextS < startS + WarmUpS + seconds; nextS += 1.0 / 60)
                {
                    if (nextS < startS + WarmUpS) frames = points = 0;
                    if (frames++ == 0) cpuMs = Cpu(process);
                    link.SendPose(TWH, clock.ElapsedTicks * 100);
                    HeadsetState state = link.State();
                    if (state.Live != null && state.Live.Version != version)
                    {
                        version = state.Live.Version;
                        points += state.Live.Count;
                    }
                    double waitS = nextS + 1.0 / 60 - clock.Elapsed.TotalSeconds;
                    if (waitS > 0) Thread.Sleep(TimeSpan.FromSeconds(waitS));
                }
                Console.WriteLine(frames + " " + (long)(Cpu(process) - cpuMs) + " " + points);
            }
        }

        /// <summary>
        /// Draws 90 frames a second with the PC at this port of the machine. Prints for each line of
        /// the input, a time in seconds, the milliseconds of its slowest frame and the strangers' datagrams.
        /// </summary>
        public static void Frames(int port)
        {
            var TWH = new double[] { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 };
            var clock = Stopwatch.StartNew();
            using (var link = new HeadsetLink("127.0.0.1", port, new byte[16], 7, new Device(), new Kept(), () => 0))
            {
                string line;
                while ((line = Console.ReadLine()) != null)
                {
                    double endS = clock.Elapsed.TotalSeconds + double.Parse(line, CultureInfo.InvariantCulture), worstMs = 0;
                    long before = link.Rejected(Rejection.Unpaired);
                    while (clock.Elapsed.TotalSeconds < endS)
                    {
                        double startMs = clock.Elapsed.TotalMilliseconds;
                        link.State();
                        link.SendPose(TWH, 1);
                        worstMs = Math.Max(worstMs, clock.Elapsed.TotalMilliseconds - startMs);
                        Thread.Sleep(11);
                    }
                    Console.WriteLine((long)Math.Ceiling(worstMs) + " " + (link.Rejected(Rejection.Unpaired) - before));
                }
            }
        }

        static double Cpu(Process process)
        {
            process.Refresh();
            return process.TotalProcessorTime.TotalMilliseconds;
        }
    }
}
