using System;
using System.Globalization;
using System.Net;
using System.Net.Sockets;
using System.Numerics;
using System.Security.Cryptography;
using System.Text;

namespace Handcal.Link
{
    /// <summary>
    /// Agreement on a pairing key by the QR code or the 8 digits that the PC shows; protocol.md,
    /// "Pairing". It takes some tenths of a second: call it from a thread of its own.
    /// </summary>
    public sealed class Exchange
    {
        const int Count = 8, ValueBytes = 256, GeneratorBytes = 272, SecretBytes = 32, KeyBytes = 24, ProofBytes = 16;
        const int ResendMs = 200;
        static readonly BigInteger Prime = BigInteger.Parse(
            "0FFFFFFFFFFFFFFFFC90FDAA22168C234C4C6628B80DC1CD129024E088A67CC74"
            + "020BBEA63B139B22514A08798E3404DDEF9519B3CD3A431B302B0A6DF25F1437"
            + "4FE1356D6D51C245E485B576625E7EC6F44C42E9A637ED6B0BFF5CB6F406B7ED"
            + "EE386BFB5A899FA5AE9F24117C4B1FE649286651ECE45B3DC2007CB8A163BF05"
            + "98DA48361C55D39A69163FA8FD24CF5F83655D23DCA3AD961C62F356208552BB"
            + "9ED529077096966D670C354E4ABC9804F1746C08CA18217C32905E462E36CE3B"
            + "E39E772C180E86039B2783A2EC07A28FB5C55DF06F4C52C9DE2BCBF695581718"
            + "3995497CEA956AE515D2261898FA051015728E5A8AACAA68FFFFFFFFFFFFFFFF",
            NumberStyles.HexNumber, CultureInfo.InvariantCulture);
        static readonly byte[] Salt = Encoding.ASCII.GetBytes("handcal pair 2");
        static readonly byte[] ToPc = Encoding.ASCII.GetBytes("handcal pair to pc");
        static readonly byte[] ToHeadset = Encoding.ASCII.GetBytes("handcal pair to headset");

        readonly bool isByCode;
        readonly ulong device;
        readonly byte[] attempt;  // identity and nonce
        readonly byte[] nonce, value;
        readonly BigInteger secret;
        byte[] cookie = new byte[0];

        internal Exchange(string code, bool isByCode, ulong device, byte[] nonce, byte[] secretBytes)
        {
            this.isByCode = isByCode;
            this.device = device;
            this.nonce = nonce;
            attempt = Keys.Join(Keys.BigEndian(device), nonce);
            secret = FromBigEndian(secretBytes);
            byte[] info = Keys.Join(Encoding.ASCII.GetBytes("generator"), attempt);
            BigInteger root = FromBigEndian(
                Keys.Hkdf(Encoding.ASCII.GetBytes(code), Salt, info, GeneratorBytes)) % Prime;
            value = ToBigEndian(BigInteger.ModPow(root, 2 * secret, Prime));
        }

        /// <summary>
        /// Asks the PC for a pairing key by its QR code; null, with the reason in `problem`, if there
        /// is none.
        /// </summary>
        public static byte[] PairByCode(
            Invitation invitation, ulong device, string name, double timeoutS, out string problem)
        {
            return Pair(invitation.Host, invitation.Port, invitation.Code, true, device, name, timeoutS, out problem);
        }

        /// <summary>The same by the digits that the PC shows.</summary>
        public static byte[] PairByDigits(
            string host, int port, string text, ulong device, string name, double timeoutS, out string problem)
        {
            var digits = new StringBuilder();
            foreach (char one in text)
                if (one >= '0' && one <= '9') digits.Append(one);
            if (digits.Length == Count)
                return Pair(host, port, digits.ToString(), false, device, name, timeoutS, out problem);
            problem = "The code has 8 digits: read it again from the PC's screen.";
            return null;
        }

        static byte[] Pair(
            string host, int port, string code, bool isByCode, ulong device, string name, double timeoutS,
            out string problem)
        {
            var exchange = new Exchange(
                code, isByCode, device, Keys.RandomBytes(Keys.NonceBytes), Keys.RandomBytes(SecretBytes));
            try
            {
                return exchange.Ask(host, port, name, timeoutS, out problem);
            }
            catch (SocketException error)
            {
                problem = "The PC at " + host + " cannot be reached: " + error.Message;
                return null;
            }
        }

        byte[] Ask(string host, int port, string name, double timeoutS, out string problem)
        {
            var answer = new byte[HeadsetLink.MostUdpBytes];
            var clock = System.Diagnostics.Stopwatch.StartNew();
            using (Socket socket = HeadsetLink.Open(host, port))
            {
                while (clock.Elapsed.TotalSeconds < timeoutS)
                {
                    try
                    {
                        byte[] asked = cookie;
                        socket.Send(Request(name));
                        double resendS = clock.Elapsed.TotalSeconds + 0.001 * ResendMs;  // whatever else arrives
                        while (asked == cookie && clock.Elapsed.TotalSeconds < resendS
                            && socket.Poll(1000 * ResendMs, SelectMode.SelectRead))
                        {
                            int size = socket.Receive(answer);
                            if (TryRead(answer, size, out byte[] key, out problem)) return key;
                        }
                    }
                    catch (SocketException error)
                    {
                        if (!HeadsetLink.IsHarmless(error)) throw;
                        System.Threading.Thread.Sleep(ResendMs);
                    }
                }
            }
            problem = "No PC answered: show a code on it with handcal pair.";
            return null;
        }

        internal byte[] Request(string name)
        {
            byte[] payload = Envelope.Pair(nonce, value, name, cookie, isByCode);
            var datagram = new byte[Datagram.MaxBytes];
            var packet = new Packet { Sequence = device, FragmentCount = 1, Bytes = payload, Count = payload.Length };
            using (var mac = new HMACSHA256(ToPc)) Array.Resize(ref datagram, Datagram.Seal(mac, packet, datagram));
            return datagram;
        }

        /// <summary>Reads an answer of the PC; true if it ends the attempt. A cookie is kept for the next request.</summary>
        internal bool TryRead(byte[] datagram, int size, out byte[] key, out string problem)
        {
            key = null;
            problem = "";
            if (Datagram.Read(datagram, size, out Packet packet) != Rejection.None || packet.Sequence != device)
                return false;
            using (var mac = new HMACSHA256(ToHeadset))
                if (!Datagram.IsAuthentic(mac, datagram, size)) return false;
            byte[] echo = new byte[0], pcValue = new byte[0], proof = new byte[0], newCookie = cookie;
            int body;
            try
            {
                var envelope = new ProtoReader(datagram, packet.Start, packet.Count);
                if (!envelope.Next(out body)) return false;
                ProtoReader message = envelope.Message();
                while (message.Next(out int field))
                {
                    if (field == 1) echo = message.Bytes();
                    else if (field == 2 && body == (int)Body.Retry) newCookie = message.Bytes();
                    else if (field == 2 && body == (int)Body.Paired) pcValue = message.Bytes();
                    else if (field == 3 && body == (int)Body.Paired) proof = message.Bytes();
                }
            }
            catch (MalformedException)
            {
                return false;
            }
            if (!Keys.AreEqual(echo, nonce)) return false;
            cookie = newCookie;
            if (body == (int)Body.Refused)
                problem = "The PC takes no more codes after too many wrong ones: show a new one on the PC.";
            else if (body != (int)Body.Paired || !IsValue(pcValue)) return false;
            else
            {
                key = Agree(pcValue, proof);
                if (key == null) problem = "The code is wrong: read it again from the PC's screen.";
            }
            return true;
        }

        /// <summary>The pairing key, or null if the PC has another code.</summary>
        byte[] Agree(byte[] pcValue, byte[] proof)
        {
            byte[] shared = ToBigEndian(BigInteger.ModPow(FromBigEndian(pcValue), secret, Prime));
            byte[] context = Keys.Join(attempt, value, pcValue);
            byte[] expected = Keys.Hkdf(shared, Salt, Keys.Join(Encoding.ASCII.GetBytes("proof"), context), ProofBytes);
            if (!Keys.AreEqual(expected, proof)) return null;
            byte[] key = Keys.Hkdf(shared, Salt, Keys.Join(Encoding.ASCII.GetBytes("key"), context), KeyBytes);
            return Encoding.ASCII.GetBytes(BitConverter.ToString(key).Replace("-", "").ToLowerInvariant());
        }

        static bool IsValue(byte[] bytes)
        {
            BigInteger number = FromBigEndian(bytes);
            return bytes.Length == ValueBytes && number > 1 && number < Prime - 1;
        }

        static BigInteger FromBigEndian(byte[] bytes)
        {
            var little = new byte[bytes.Length + 1];  // the last, 0, makes it positive
            for (int i = 0; i < bytes.Length; i++) little[i] = bytes[bytes.Length - 1 - i];
            return new BigInteger(little);
        }

        static byte[] ToBigEndian(BigInteger number)
        {
            byte[] little = number.ToByteArray();
            var bytes = new byte[ValueBytes];
            for (int i = 0; i < Math.Min(little.Length, ValueBytes); i++) bytes[ValueBytes - 1 - i] = little[i];
            return bytes;
        }
    }
}
