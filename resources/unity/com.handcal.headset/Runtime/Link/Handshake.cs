using System;
using System.Security.Cryptography;

namespace Handcal.Link
{
    /// <summary>One session with the PC.</summary>
    sealed class Session
    {
        public readonly ulong Number;
        public readonly HMACSHA256 SendMac, ReceiveMac;
        public readonly ReplayWindow Window = new ReplayWindow();
        public readonly Inbox Inbox = new Inbox();
        public ulong Sequence;
        public double HeardS;

        public Session(ulong number, Keys keys)
        {
            Number = number;
            SendMac = new HMACSHA256(keys.ToPc);
            ReceiveMac = new HMACSHA256(keys.ToHeadset);
        }
    }

    enum Answer
    {
        None,
        SayHelloAgain,
        Welcomed,
        Refused,
    }

    /// <summary>The headset's half of protocol.md, "Handshake".</summary>
    sealed class Handshake
    {
        const int MaxCookieBytes = 32;
        const ulong RefusalKeyTaken = 2;
        static readonly DateTime Epoch = new DateTime(1970, 1, 1, 0, 0, 0, DateTimeKind.Utc);
        readonly byte[] pairingKey;
        readonly ulong device;
        readonly HMACSHA256 sendMac, receiveMac;
        byte[] nonce, cookie;
        ulong helloNs;

        public Handshake(byte[] pairingKey, ulong device)
        {
            this.pairingKey = pairingKey;
            this.device = device;
            Keys keys = Keys.OfHandshake(pairingKey, device);
            sendMac = new HMACSHA256(keys.ToPc);
            receiveMac = new HMACSHA256(keys.ToHeadset);
            BeginAgain();
        }

        /// <summary>The session of the last welcome.</summary>
        public Session Session { get; private set; }

        /// <summary>The last refusal, for the wearer.</summary>
        public string Refusal { get; private set; } = "";

        /// <summary>Writes a hello, newer than every one before; returns its size.</summary>
        public int Hello(string name, byte[] into)
        {
            var nowNs = (ulong)(DateTime.UtcNow - Epoch).Ticks * 100;
            helloNs = Math.Max(nowNs, helloNs + 1);
            byte[] payload = Envelope.Hello(nonce, helloNs, cookie, name);
            var packet = new Packet { Sequence = device, FragmentCount = 1, Bytes = payload, Count = payload.Length };
            return Datagram.Seal(sendMac, packet, into);
        }

        /// <summary>Takes an answer of the PC; one with another nonce is an old one.</summary>
        public Rejection Take(Packet packet, byte[] bytes, int size, out Answer answer)
        {
            answer = Answer.None;
            if (packet.Sequence != device) return Rejection.WrongSession;
            if (!Datagram.IsAuthentic(receiveMac, bytes, size)) return Rejection.Unpaired;
            var envelope = new ProtoReader(bytes, packet.Start, packet.Count);
            if (!envelope.Next(out int body)) throw new MalformedException("an empty envelope");
            byte[] echo = new byte[0], second = new byte[0];
            ulong number = 0, reason = 0;
            string other = "";
            ProtoReader message = envelope.Message();
            while (message.Next(out int field))
            {
                if (field == 1) echo = message.Bytes();
                else if (body == (int)Body.Retry && field == 2) second = message.Bytes();
                else if (body == (int)Body.Welcome && field == 2) number = message.Fixed();
                else if (body == (int)Body.Welcome && field == 3) second = message.Bytes();
                else if (body == (int)Body.Refused && field == 2) reason = message.Number();
                else if (body == (int)Body.Refused && field == 3) other = Check.Text(message.Text(), 40);
            }
            if (!Keys.AreEqual(echo, nonce)) return Rejection.Replayed;
            switch ((Body)body)
            {
                case Body.Retry:
                    if (cookie.Length == 0) answer = Answer.SayHelloAgain;  // at once, but only once
                    if (second.Length > MaxCookieBytes) Array.Resize(ref second, MaxCookieBytes);
                    cookie = second;
                    return Rejection.None;
                case Body.Welcome:
                    if (number == 0 || second.Length != Keys.NonceBytes)
                        throw new MalformedException("a welcome without a session");
                    Session = new Session(number, Keys.OfSession(pairingKey, device, number, nonce, second));
                    answer = Answer.Welcomed;
                    BeginAgain();
                    return Rejection.None;
                case Body.Refused:
                    Refusal = reason == RefusalKeyTaken
                        ? "This pairing key belongs to " + other + ": pair this headset again"
                        : other + " is connected to the PC: close its app first";
                    answer = Answer.Refused;
                    BeginAgain();
                    return Rejection.None;
                default:
                    throw new MalformedException("no answer to a hello");
            }
        }

        /// <summary>Forgets the handshake, so that no old answer is accepted.</summary>
        void BeginAgain()
        {
            nonce = Keys.RandomBytes(Keys.NonceBytes);
            cookie = new byte[0];
        }
    }
}
