using System.Collections.Generic;
using System.IO;
using System.Security.Cryptography;

namespace Handcal.Link
{
    /// <summary>The things that the PC wants shown; a value that no longer changes.</summary>
    public sealed class HeadsetState
    {
        /// <summary>Null until one has come; without points there is nothing to draw.</summary>
        public Cursor Cursor { get; internal set; }

        /// <summary>The live hand; null if there is none. Overwritten by the next State().</summary>
        public LiveHand Live { get; internal set; }

        public string Prompt { get; internal set; } = "";

        /// <summary>The eyes to keep open.</summary>
        public Eyes OpenEyes { get; internal set; } = Eyes.Both;

        /// <summary>Null until the PC has sent it, or a kept one is shown.</summary>
        public Projection Left { get; internal set; }
        public Projection Right { get; internal set; }

        /// <summary>True while the offline calibration is to be drawn with.</summary>
        public bool IsOffline { get; internal set; }

        public Target Target { get; internal set; }
        public Shape Shape { get; internal set; }

        /// <summary>The eye whose drawing the wearer is to move; null if there is none.</summary>
        public Verify Verify { get; internal set; }

        public Projection ProjectionOf(Eyes eye)
        {
            return eye == Eyes.Left ? Left : Right;
        }

        /// <summary>Wearer and rig of the projections; empty if there are none.</summary>
        public string Wearer { get { return (Left ?? Right)?.Wearer ?? ""; } }
        public string Rig { get { return (Left ?? Right)?.Rig ?? ""; } }

        internal HeadsetState Copy()
        {
            return (HeadsetState)MemberwiseClone();
        }

        /// <summary>Takes a message that changes what is shown, other than a projection.</summary>
        internal void Take(Body body, ProtoReader message)
        {
            switch (body)
            {
                case Body.Cursor: Cursor = new Cursor(message); break;
                case Body.LiveHand:
                    Live = Live ?? new LiveHand();
                    Live.Take(message);
                    break;
                case Body.Prompt: TakePrompt(message); break;
                case Body.Target: Target = Target.Read(message); break;
                case Body.Shape: Shape = Shape.Read(message); break;
                case Body.Show: TakeShow(message); break;
                case Body.Verify: Verify = Verify.Read(message); break;
                default: throw new MalformedException("a PC sends no such message");
            }
        }

        void TakePrompt(ProtoReader message)
        {
            string text = "";
            var eyes = new List<ulong>();
            while (message.Next(out int field))
            {
                if (field == 1) text = message.Text();
                else if (field == 2) message.Numbers(eyes);
            }
            OpenEyes = Check.EyesOrBoth(eyes);
            Prompt = text;
        }

        void TakeShow(ProtoReader message)
        {
            IsOffline = false;
            while (message.Next(out int field))
                if (field == 1) IsOffline = message.Number() != 0;
        }

        /// <summary>Digest of what is drawn; protocol.md, "Confirm".</summary>
        public byte[] Digest()
        {
            var content = new MemoryStream();
            var writer = new BinaryWriter(content);  // little endian
            foreach (Projection one in new[] { Left, Right })
            {
                writer.Write(one != null);
                if (one == null) continue;
                foreach (double number in one.Drawn(IsOffline)) writer.Write(number);
                foreach (double number in one.TVH) writer.Write(number);
                writer.Write((uint)one.WidthPx);
                writer.Write((uint)one.HeightPx);
            }
            writer.Write(Cursor == null ? 0u : Cursor.Id);
            if (Cursor != null)
            {
                foreach (double number in Cursor.Points.OriginM) writer.Write(number);
                writer.Write(Cursor.Points.Offsets);
            }
            writer.Flush();
            var digest = new byte[16];
            using (var sha = SHA256.Create())
                System.Buffer.BlockCopy(sha.ComputeHash(content.ToArray()), 0, digest, 0, 16);
            return digest;
        }
    }
}
