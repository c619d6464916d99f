using System;
using System.Security.Cryptography;
using System.Text;

namespace Handcal.Link
{
    /// <summary>The MAC keys of the two directions; protocol.md, "Devices and keys".</summary>
    public sealed class Keys
    {
        public const int MinPairingKeyBytes = 16;
        public const int NonceBytes = 16;
        const int KeyBytes = 32;
        static readonly byte[] Salt = Encoding.ASCII.GetBytes("handcal link 2");

        public readonly byte[] ToPc;
        public readonly byte[] ToHeadset;

        Keys(byte[] pairingKey, string kind, byte[] context)
        {
            ToPc = Hkdf(pairingKey, Salt, Join(Encoding.ASCII.GetBytes(kind + " to pc"), context), KeyBytes);
            ToHeadset = Hkdf(pairingKey, Salt, Join(Encoding.ASCII.GetBytes(kind + " to headset"), context), KeyBytes);
        }

        /// <summary>The keys of a device's handshakes.</summary>
        public static Keys OfHandshake(byte[] pairingKey, ulong device)
        {
            return new Keys(pairingKey, "handshake", BigEndian(device));
        }

        /// <summary>The keys of one session of a device.</summary>
        public static Keys OfSession(
            byte[] pairingKey, ulong device, ulong session, byte[] headsetNonce, byte[] pcNonce)
        {
            byte[] context = Join(BigEndian(device), BigEndian(session), headsetNonce, pcNonce);
            return new Keys(pairingKey, "session", context);
        }

        /// <summary>Random bytes for identities and nonces.</summary>
        public static byte[] RandomBytes(int count)
        {
            var bytes = new byte[count];
            using (var random = RandomNumberGenerator.Create()) random.GetBytes(bytes);
            return bytes;
        }

        /// <summary>Bytes by HKDF-SHA256 (RFC 5869).</summary>
        internal static byte[] Hkdf(byte[] key, byte[] salt, byte[] info, int size)
        {
            byte[] root, block = new byte[0];
            using (var extract = new HMACSHA256(salt)) root = extract.ComputeHash(key);
            var derived = new byte[size];
            using (var expand = new HMACSHA256(root))
            {
                for (int at = 0; at < size; at += block.Length)
                {
                    block = expand.ComputeHash(Join(block, info, new[] { (byte)(at / 32 + 1) }));
                    Buffer.BlockCopy(block, 0, derived, at, Math.Min(block.Length, size - at));
                }
            }
            return derived;
        }

        internal static bool AreEqual(byte[] a, byte[] b)
        {
            int difference = a.Length ^ b.Length;
            for (int i = 0; i < Math.Min(a.Length, b.Length); i++) difference |= a[i] ^ b[i];
            return difference == 0;
        }

        internal static byte[] BigEndian(ulong value)
        {
            var bytes = new byte[8];
            Datagram.WriteBigEndian(bytes, 0, 8, value);
            return bytes;
        }

        internal static byte[] Join(params byte[][] parts)
        {
            int size = 0;
            foreach (byte[] part in parts) size += part.Length;
            var joined = new byte[size];
            int at = 0;
            foreach (byte[] part in parts)
            {
                Buffer.BlockCopy(part, 0, joined, at, part.Length);
                at += part.Length;
            }
            return joined;
        }
    }
}
