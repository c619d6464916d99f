using System;
using System.Security.Cryptography;

namespace Handcal.Link
{
    /// <summary>Each slot holds one reliable message, and the newest wins.</summary>
    public enum Slot : byte
    {
        Unreliable = 0,
        Cursor = 1,
        Prompt = 2,
        ProjectionLeft = 3,
        ProjectionRight = 4,
        Confirm = 5,
        Target = 6,
        Device = 7,
        Shape = 8,
        Show = 9,
        Verify = 10,
        Nudge = 11,
    }

    /// <summary>Reasons for dropping a datagram; `None` is accepted.</summary>
    public enum Rejection
    {
        None,
        Oversized,
        Corrupt,
        WrongVersion,
        Unpaired,
        WrongSession,
        Replayed,
    }

    /// <summary>A datagram without its MAC. The payload is a part of <see cref="Bytes"/>.</summary>
    public struct Packet
    {
        public Slot Slot;
        public ulong Session;

        /// <summary>In the handshake: the device's identity.</summary>
        public ulong Sequence;

        public uint MessageId;
        public int Fragment;
        public int FragmentCount;
        public byte[] Bytes;
        public int Start;
        public int Count;
    }

    /// <summary>Datagrams as bytes; protocol.md, "Datagram".</summary>
    public static class Datagram
    {
        public const int Version = 2;
        public const int HeaderBytes = 28;
        public const int MacBytes = 16;
        public const int MaxBytes = 1400;
        public const int MaxPayloadBytes = MaxBytes - HeaderBytes - MacBytes;
        public const int MaxFragments = 256;
        const Slot LastSlot = Slot.Nudge;

        /// <summary>Writes header, payload and MAC into a buffer; returns the size.</summary>
        public static int Seal(HMACSHA256 mac, Packet packet, byte[] into)
        {
            into[0] = (byte)'h';
            into[1] = (byte)'C';
            into[2] = Version;
            into[3] = (byte)packet.Slot;
            WriteBigEndian(into, 4, 8, packet.Session);
            WriteBigEndian(into, 12, 8, packet.Sequence);
            WriteBigEndian(into, 20, 4, packet.MessageId);
            WriteBigEndian(into, 24, 2, (ulong)packet.Fragment);
            WriteBigEndian(into, 26, 2, (ulong)packet.FragmentCount);
            Buffer.BlockCopy(packet.Bytes, packet.Start, into, HeaderBytes, packet.Count);
            int body = HeaderBytes + packet.Count;
            Buffer.BlockCopy(mac.ComputeHash(into, 0, body), 0, into, body, MacBytes);
            return body + MacBytes;
        }

        /// <summary>Reads a datagram; believe nothing in it before <see cref="IsAuthentic"/>.</summary>
        public static Rejection Read(byte[] bytes, int size, out Packet packet)
        {
            packet = new Packet();
            if (size > MaxBytes) return Rejection.Oversized;
            if (size < HeaderBytes + MacBytes || bytes[0] != 'h' || bytes[1] != 'C')
                return Rejection.Corrupt;
            if (bytes[2] != Version) return Rejection.WrongVersion;
            packet.Slot = (Slot)bytes[3];
            packet.Session = ReadBigEndian(bytes, 4, 8);
            packet.Sequence = ReadBigEndian(bytes, 12, 8);
            packet.MessageId = (uint)ReadBigEndian(bytes, 20, 4);
            packet.Fragment = (int)ReadBigEndian(bytes, 24, 2);
            packet.FragmentCount = (int)ReadBigEndian(bytes, 26, 2);
            packet.Bytes = bytes;
            packet.Start = HeaderBytes;
            packet.Count = size - HeaderBytes - MacBytes;
            if (packet.FragmentCount > MaxFragments) return Rejection.Oversized;
            bool isWhole = packet.Slot != Slot.Unreliable || packet.FragmentCount == 1;
            bool isKnown = packet.Slot <= LastSlot && packet.Fragment < packet.FragmentCount;
            return isWhole && isKnown ? Rejection.None : Rejection.Corrupt;
        }

        /// <summary>True if the datagram bears the MAC of this key; compared in constant time.</summary>
        public static bool IsAuthentic(HMACSHA256 mac, byte[] bytes, int size)
        {
            byte[] expected = mac.ComputeHash(bytes, 0, size - MacBytes);
            int difference = 0;
            for (int i = 0; i < MacBytes; i++)
                difference |= expected[i] ^ bytes[size - MacBytes + i];
            return difference == 0;
        }

        internal static void WriteBigEndian(byte[] bytes, int start, int count, ulong value)
        {
            for (int i = count - 1; i >= 0; i--, value >>= 8) bytes[start + i] = (byte)value;
        }

        static ulong ReadBigEndian(byte[] bytes, int start, int count)
        {
            ulong value = 0;
            for (int i = 0; i < count; i++) value = value << 8 | bytes[start + i];
            return value;
        }
    }
}
